"""How long it takes from a drag of the mouse to the picture that shows it, measured in the page.

The script notes when the mouse moved whose place the page sends, and waits for the step that went
by this very place: the server puts a node of the scene there, together with all poses of that step.
The picture counts as shown when the browser begins the frame after the one that draws them. Where a
browser has no graphics card, the script asks for the quick picture, as a hand would.
"""

from __future__ import annotations

from typing import Any

from layouts.viewer.text import STYLE, node

HTML_ID = "from-drag-to-picture"
QUICK = "Quick picture"  # a box on the panel
MOST = 200  # drags that count
NOTHING_YET = "Time from drag to picture: not measured yet"
GIZMOS, STEERED = "(gizmos)", "(steered)"

_SCRIPT = """
if (!window.dragsSeen) {
  const waiting = [], seen = window.dragsSeen = [], known = new WeakSet();
  let moved = 0;
  const send = Worker.prototype.postMessage;
  window.addEventListener("pointermove", (event) => { moved = event.timeStamp; }, true);
  const show = () => {
    const ranked = [...seen].sort((one, other) => one - other);
    const at = (share) => ranked[Math.floor(share * (ranked.length - 1))].toFixed(0);
    const place = document.getElementById("HTML_ID");
    if (place) place.textContent =
      `Time from drag to picture: ${at(0.5)} ms (median), ${at(0.95)} ms (95 %), of ${seen.length}`;
  };
  document.addEventListener("change", (event) => {  // else the box would keep all keys to itself
    if (event.target.type === "checkbox") event.target.blur();
  });
  const canvas = document.createElement("canvas").getContext("webgl");
  const about = canvas?.getExtension("WEBGL_debug_renderer_info");
  const renderer = about ? canvas.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  const choose = setInterval(() => {
    const named = [...document.querySelectorAll("label")];
    const label = named.find((label) => label.textContent.trim() === "QUICK");
    const box = label && document.getElementById(label.htmlFor);
    if (!box) return;
    clearInterval(choose);
    if (!box.checked && /swiftshader|llvmpipe|software/i.test(renderer)) box.click();
  }, 200);
  const arrived = (message) => {
    const found = waiting.findIndex((drag) => drag.node === message.name &&
      drag.place.every((x, i) => Math.abs(x - message.position[i]) < 1e-7));
    if (found < 0) return;
    const drag = waiting[found];
    for (let i = found; i >= 0; i--) if (waiting[i].node === drag.node) waiting.splice(i, 1);
    requestAnimationFrame(() => requestAnimationFrame((now) => {
      seen.push(now - drag.when);
      if (seen.length > MOST) seen.shift();
      show();
    }));
  };
  const listen = (event) => {
    for (const message of event.data.messages ?? [])
      if (message.type === "SetPositionMessage" && waiting.length) arrived(message);
  };
  Worker.prototype.postMessage = function (data, ...rest) {
    const message = data?.type === "send" ? data.message : null;
    if (message?.type === "TransformControlsUpdateMessage") {
      if (!known.has(this)) { known.add(this); this.addEventListener("message", listen); }
      const node = message.name.replace("GIZMOS", "STEERED");
      waiting.push({ node, place: [...message.position], when: moved });
      if (waiting.length > MOST) waiting.shift();
    }
    return send.call(this, data, ...rest);
  };
}
"""


class Stopwatch:
    """Lets pages show how long drags take to be seen."""

    def __init__(self, server: Any, arms: tuple[str, ...]) -> None:
        """Send the script to all browsers that open the page, and add the line that it fills in.

        Args:
            server: A viser server.
            arms: What is dragged; their gizmos are called as `gizmo_node` says.
        """
        from viser import _messages

        source = _SCRIPT
        for name in ("HTML_ID", "QUICK", "MOST", "GIZMOS", "STEERED"):
            source = source.replace(name, str(globals()[name]))
        server.gui.add_html(f'<div style="{STYLE}" id="{HTML_ID}">{NOTHING_YET}</div>')
        server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(source))
        self._nodes = {
            arm: server.scene.add_frame(node(STEERED, arm), show_axes=False) for arm in arms
        }

    def stepped(self, arm: str, place: tuple[float, float, float]) -> None:
        """Tell browsers where an arm was to go in the step whose poses are sent along."""
        self._nodes[arm].position = place


def gizmo_node(arm: str) -> str:
    """Return what the gizmo of an arm is called in the scene."""
    return node(GIZMOS, arm)
