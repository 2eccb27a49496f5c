// Each frame of the scene is one of FRAMES, in order; `frames.js` reports its number, from 1, before it is drawn.
const box = document.querySelector("aside details"), all = (name) => box.querySelectorAll(".towline-" + name);
if (innerWidth < innerHeight) box.open = false;
let shown = 0;
if (FRAMES.clocks.length > 1) addEventListener("towline-instant", (event) => {
  const k = event.detail - 1;
  if (k === shown) return;
  shown = k;
  all("status")[0].textContent = FRAMES.statuses[k];
  all("time")[0].textContent = FRAMES.clocks[k];
  FRAMES.tensions[k].forEach((tension, i) => {
    all("tension")[i].textContent = tension === null ? "none" : tension.toFixed(FRAMES.digits) + " N";
    all("bar")[i].style.width = FRAMES.widths[k][i] + "%";
    all("bar")[i].style.background = FRAMES.colours[k][i];
  });
});
