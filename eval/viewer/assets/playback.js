// Going from scan to scan.

let request = 0; // of two scans that are decoded at the same time, only the later request is shown

async function go(index) {
  const mine = ++request, target = Math.min(last, Math.max(0, index));
  const content = await decode(target);
  if (mine !== request) return;
  state.scan = target;
  shown = content;
  draw();
  if (target < last) decode(target + 1);
}

function draw() {
  if (!shown || !$("stage").clientWidth) return; // without a size: drawn when it has one
  paint();
  drawMarks();
  drawNow();
  drawFacts();
  drawMovers();
  highlight(state.hovered);
  drawReadout();
  $("slider").value = state.scan;
  $("slider").setAttribute("aria-valuetext", `scan ${state.scan + 1} of ${scans.length}`);
  $("place").textContent = `${String(state.scan + 1).padStart(String(scans.length).length, " ")} / ${scans.length}`;
  document.body.dataset.scan = state.scan;
}

const gaps = scans.slice(1).map((each, i) => (each.stamp_us - scans[i].stamp_us) / 1000).sort((a, b) => a - b);
const gapMs = Math.min(2000, Math.max(100, gaps[gaps.length >> 1] || 250));

async function play(on) {
  if (state.playing === on || (on && !last)) return;
  state.playing = on;
  $("play").classList.toggle("playing", on);
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  let due = performance.now();
  while (state.playing) {
    due = Math.max(due + gapMs / Number($("pace").value), performance.now());
    await new Promise((done) => setTimeout(done, due - performance.now()));
    if (state.playing) await go(state.scan < last ? state.scan + 1 : 0);
  }
}
