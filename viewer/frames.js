// In each frame of the browser: apply the messages of whole instants, let React change lines and text, and draw then.
// Between the callbacks of one frame a browser finishes promises, and paints nothing. React hands its work to
// `setImmediate` if it exists when viser's client starts. If a later version of viser has no such queue, all is as it
// was without the script.
{
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
}
