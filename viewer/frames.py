"""Show all that belongs to one instant in one frame of a browser: scene, table, charts and clock.

viser applies what a server sends in three steps: it moves bodies when it draws, changes text as soon as it can, and
gives lines their new points after it has drawn. Where drawing takes long, each picture then has bodies, cables and
numbers of several instants. So the page gets a script, and each instant is sent between two marks.
"""

from __future__ import annotations

import contextlib
import gzip
from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser
    from websockets.http11 import Response

BEGUN, ENDED = "/frames/begun", "/frames/ended"

# In each frame of the browser: apply the messages of whole instants, let React change lines and text, and draw then.
# Between the callbacks of one frame a browser finishes promises, and paints nothing. React hands its work to
# `setImmediate` if it exists when viser's client starts. If a later version of viser has no such queue, all is as it
# was without the script.
ATOMIC = """<script>{
const tasks = [], channel = new MessageChannel(), work = () => {
  for (const task of tasks.splice(0)) try { task() } catch (error) { reportError(error) }
};
channel.port1.onmessage = work;
window.setImmediate = (task) => { tasks.push(task); channel.port2.postMessage(null) };

let viewer = null;
const search = () => {  // the value that viser's client shares among its components
  const root = document.getElementById("root");
  const key = root && Object.keys(root).find((name) => name.startsWith("__reactContainer"));
  const left = key ? [root[key].stateNode.current] : [];
  for (let k = 0; left.length && k < 1000; k++) {
    const fiber = left.shift(), found = fiber.memoizedProps?.value?.mutable?.current;
    if (found?.messageQueue && found.drainMessageQueue) return found;
    left.push(...[fiber.child, fiber.sibling].filter((next) => next));
  }
  return null;
};
const marks = () => {  // the last instant that has begun, and that has ended
  const last = {};
  for (const message of viewer?.messageQueue ?? [])
    if (message.type === "SetPositionMessage") last[message.name] = message.position[0];
  return [last["BEGUN"], last["ENDED"]];
};

const request = window.requestAnimationFrame.bind(window), waiting = new Map();
let number = 0, scheduled = false, since = null, whole = true;
const schedule = () => {
  if (!scheduled) { scheduled = true; request(apply); request(draw); }
};
const apply = () => {
  if (!viewer?.drainMessageQueue) viewer = search();
  const [begun, ended] = marks();
  whole = begun === undefined || ended >= begun;
  since = whole ? null : since ?? performance.now();
  whole ||= performance.now() - since > 500;  // [ms]: the server has gone
  if (!whole || !viewer) return;
  viewer.drainMessageQueue();
  if (ended !== undefined) dispatchEvent(new CustomEvent("towline-instant", { detail: ended }));
  const settle = async () => {
    for (let k = 0; k < 100; k++) {
      await null;
      if (k > 2 && !tasks.length) return;
      work();
    }
  };
  settle();
};
const draw = (now) => {
  scheduled = false;
  if (!whole) return schedule();
  for (const key of [...waiting.keys()]) {
    const callback = waiting.get(key);
    waiting.delete(key);
    if (callback) try { callback(now) } catch (error) { reportError(error) }
  }
};
window.requestAnimationFrame = (callback) => {
  waiting.set(++number, callback);
  schedule();
  return number;
};
window.cancelAnimationFrame = (key) => waiting.delete(key);
}</script>""".replace("BEGUN", BEGUN).replace("ENDED", ENDED)


class Frames:
    """The marks of instants on a viser server."""

    def __init__(self, server: viser.ViserServer):
        self._server, self._count = server, 0
        self._begun, self._ended = (server.scene.add_frame(name, show_axes=False) for name in (BEGUN, ENDED))

    @contextlib.contextmanager
    def instant(self) -> Iterator[None]:
        """Send what is changed in this block so that a browser shows all of it in one frame.

        Even an atomic block of viser can be cut in two: its server stops reading one when the next begins.
        """
        with self._server.atomic():
            self._count += 1
            self._begun.position = (self._count, 0, 0)
            try:
                yield
            finally:
                self._ended.position = (self._count, 0, 0)


def with_script(document: str) -> str:
    """Return a page of viser's client with the script."""
    head, found, rest = document.partition("<head>")
    return f"{head}{found}{ATOMIC}{rest}" if found else document


def add_script(response: Response) -> None:
    """Add the script to a response of viser's server if it is the page."""
    if not response.headers.get("Content-Type", "").startswith("text/html") or not response.body:
        return
    zipped = response.headers.get("Content-Encoding") == "gzip"
    response.body = _with_script(bytes(response.body), zipped)
    if "Content-Length" in response.headers:
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


@lru_cache(maxsize=2)
def _with_script(body: bytes, zipped: bool) -> bytes:
    """Return the body of a response with the script, zipped as before."""
    document = with_script((gzip.decompress(body) if zipped else body).decode()).encode()
    return gzip.compress(document) if zipped else document
