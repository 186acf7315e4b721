"""A web page that tries to see and to steer a page of another origin, and the server it is on."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

# Everything that a page can do to another origin, each with what came of it.
ATTACK = """
async ([page, stream, protocol]) => {
  const patience = (promise) => Promise.race(
    [promise, new Promise((resolve) => setTimeout(() => resolve("nothing"), 4000))]);
  const fetched = async (options) => {
    try {
      const answer = await fetch(page, options);
      return "bytes: " + (await answer.text()).length;
    } catch (error) { return "refused"; }
  };
  const connected = (protocols) => new Promise((resolve) => {
    const socket = new WebSocket(stream, protocols);
    socket.onopen = () => socket.send("hello");
    socket.onmessage = (message) => resolve("bytes: " + (message.data.size || "some"));
    socket.onclose = () => resolve("refused");
  });
  const element = (name, attribute) => new Promise((resolve) => {
    const made = document.createElement(name);
    made.onload = () => resolve("loaded");
    made.onerror = () => resolve("refused");
    made[attribute] = page;
    document.body.append(made);
  });
  const framed = async (fill) => {
    const frame = document.createElement("iframe");
    frame.name = "f" + Math.random();
    const loaded = new Promise((resolve) => { frame.onload = resolve; });
    document.body.append(frame);
    fill(frame);
    await loaded;
    try {
      const body = frame.contentDocument ? frame.contentDocument.body.innerHTML : "";
      return body.length ? "bytes: " + body.length : "refused";
    } catch (error) { return "refused"; }
  };
  const form = (method) => (frame) => {
    const made = document.createElement("form");
    Object.assign(made, {action: page, method: method, target: frame.name});
    made.innerHTML = '<input name="type" value="ShareUrlRequest">';
    document.body.append(made);
    made.submit();
  };
  const opened = async () => {
    const tab = window.open(page);
    await new Promise((resolve) => setTimeout(resolve, 1000));
    try {
      return "bytes: " + tab.document.body.innerHTML.length;
    } catch (error) { return "refused"; } finally { tab.close(); }
  };
  const events = () => new Promise((resolve) => {
    const source = new EventSource(page);
    source.onmessage = () => resolve("bytes: some");
    source.onerror = () => { source.close(); resolve("refused"); };
  });
  const attempts = {
    "fetch": fetched({}),
    "fetch with credentials": fetched({credentials: "include"}),
    "fetch without CORS": fetched({mode: "no-cors", credentials: "include"}),
    "fetch by POST": fetched({method: "POST", mode: "no-cors", body: "x"}),
    "WebSocket": connected(protocol),
    "WebSocket without protocol": connected([]),
    "image": element("img", "src"),
    "script": element("script", "src"),
    "frame": framed((frame) => { frame.src = page; }),
    "GET form": framed(form("get")),
    "POST form": framed(form("post")),
    "event source": events(),
    "window": opened(),
  };
  const results = await Promise.all(Object.values(attempts).map(patience));
  return Object.fromEntries(Object.keys(attempts).map((name, i) => [name, results[i]]));
}
"""
NOTHING = ("refused", "nothing", "bytes: 0")


@contextmanager
def hostile_site() -> Iterator[tuple[int, list[str]]]:
    """Serve an empty page at another port; yield the port, and all headers that browsers send."""
    received: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            received.append(f"{self.path}\n{self.headers}")
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>hostile</title><body></body>")

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server.server_port, received
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
