"""Names that are markup, paths or addresses."""

HOSTILE_NAMES = (
    "<img src=http://127.0.0.1:9/x onerror=alert(1)>",
    "</script><script>alert(1)</script>",
    "![picture](http://127.0.0.1:9/x.png)",
    "[link](javascript:alert(1))",
    "https://evil.example/x",
    "`code` **bold** # _x_ | ~~x~~",
    "</div></details><iframe src=http://127.0.0.1:9/>",
    "a/b/../c",
    "100%2Fdone",
    "&lt;b&gt; &amp; \" ' &#60;",
    "turned \u202e round",
    "<!-- ]]> --> {{ 7 * 7 }} ${7} <%= 7 %>",
    "name \u65e5\u672c\u8a9e \U0001f916",
    "__proto__",
)
