// Buttons, sliders and keys. The last script: it starts the page.

const step = (by) => { play(false); go(state.scan + by); };
$("back").addEventListener("click", () => step(-1));
$("forth").addEventListener("click", () => step(1));
$("play").addEventListener("click", () => play(!state.playing));
$("slider").addEventListener("input", (event) => { play(false); go(Number(event.target.value)); });

for (const id of ["boxes", "rings", "obstacles", "clipped"]) {
  $(id).checked = state[id];
  $(id).addEventListener("change", (event) => { state[id] = event.target.checked; draw(); });
}

for (const name of ["view", "up", "overlay"]) {
  for (const button of document.getElementsByName(name)) {
    button.addEventListener("change", () => { state[name] = button.value; updateControls(); draw(); });
  }
}

/** Update the controls and the legend to the chosen projection and overlay. */
function updateControls() {
  for (const button of document.getElementsByName("up")) {
    button.disabled = state.view === "polar" || !data.north_up || !data.path;
  }
  const overlay = OVERLAYS[state.overlay];
  $("legend").innerHTML = !overlay ? "" : overlay.legend.map(([name, colour]) =>
    `<li><i style="background:${plainText(colour)}"></i>${plainText(name)}</li>`).join("");
  $("legend-note").textContent = overlay ? overlay.note : "";
}

/** Choose a value of a group of radio buttons, by default the next one. */
function choose(name, value) {
  const buttons = [...document.getElementsByName(name)];
  const now = buttons.findIndex((button) => button.checked);
  const next = value ? buttons.find((button) => button.value === value) : buttons[(now + 1) % buttons.length];
  if (!next.disabled && !next.matches(":disabled")) next.click();
}

const rangeOf = (share) => MIN_RANGE_M * (MAX_RANGE_M / MIN_RANGE_M) ** share;
const shareOf = (range) => Math.log(range / MIN_RANGE_M) / Math.log(MAX_RANGE_M / MIN_RANGE_M);

function setRange(range) {
  state.range = Math.min(MAX_RANGE_M, Math.max(MIN_RANGE_M, range));
  $("range").value = 100 * shareOf(state.range);
  updateSliders();
  draw();
}

function updateSliders() {
  for (const [id, text] of [["opacity", `${Math.round(100 * state.opacity)} %`],
    ["range", `${state.range.toFixed(0)} m`], ["white", `${(state.white / 2).toFixed(0)} dB`]]) {
    document.querySelector(`output[for=${id}]`).textContent = text;
    $(id).setAttribute("aria-valuetext", text);
  }
  $("half").textContent = (state.white / 4).toFixed(0);
  $("full").textContent = `${(state.white / 2).toFixed(0)} dB`;
}

$("opacity").addEventListener("input", (event) => { state.opacity = event.target.value / 100; updateSliders(); draw(); });
$("white").addEventListener("input", (event) => { state.white = 2 * event.target.value; updateSliders(); draw(); });
$("range").addEventListener("input", (event) => setRange(rangeOf(event.target.value / 100)));
$("stage").addEventListener("wheel", (event) => {
  event.preventDefault();
  setRange(state.range * Math.exp(Math.max(-60, Math.min(60, event.deltaY)) / 400));
}, { passive: false });

let overlayBefore = "component";
const KEYS = {
  ArrowLeft: () => step(-1), ArrowRight: () => step(1),
  Home: () => step(-scans.length), End: () => step(scans.length),
  " ": () => play(!state.playing),
  o: () => {
    if (state.overlay !== "off") overlayBefore = state.overlay;
    choose("overlay", state.overlay === "off" ? overlayBefore : "off");
  },
  b: () => $("boxes").click(), r: () => $("rings").click(), p: () => choose("view"), n: () => choose("up"),
  "+": () => setRange(state.range / 1.25), "=": () => setRange(state.range / 1.25),
  "-": () => setRange(state.range * 1.25),
};
document.addEventListener("keydown", (event) => {
  const act = KEYS[event.key];
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  // A focused control keeps the keys that it uses itself, except for the slider of scans.
  const holder = event.target, moves = event.key.startsWith("Arrow") || ["Home", "End"].includes(event.key);
  if (holder.matches("select, input[type=range]:not(#slider), input[type=radio]") && (moves || "+-=".includes(event.key))) return;
  if (event.key === " " && holder.matches("button, summary, select, input[type=checkbox], input[type=radio]")) return;
  event.preventDefault();
  act();
});

// After a click the keys step through the scans again: the control loses the focus.
document.addEventListener("click", (event) => {
  if (event.detail && document.activeElement.matches("main input, main button")) document.activeElement.blur();
});

new ResizeObserver(draw).observe($("stage"));

function start() {
  $("about").textContent = `${scans.length === data.total ? "" : `${scans.length} of `}${data.total} scan${data.total > 1 ? "s" : ""}`
    + ` · ${data.sensor} · ${azimuths} azimuths, range bins shown: ${(100 * columnM).toFixed(0)} cm`;
  const notes = [
    ...(data.has_truth ? [] : ["This folder has no ground truth: overlays and boxes are off."]),
    ...(data.path ? [] : ["This folder has no poses: the plan is off."]),
  ];
  $("notes").textContent = notes.join(" ");
  $("notes").hidden = !notes.length;
  $("truth").disabled = !data.has_truth;
  $("slider").max = last;
  $("white").value = state.white / 2;
  $("opacity").value = 100 * state.opacity;
  const bar = $("bar").getContext("2d");
  levelColours.forEach((colour, i) => { bar.fillStyle = `rgb(${colour})`; bar.fillRect(i, 0, 1, 1); });
  $("movers").open = innerWidth > 760;
  updateControls();
  updateSliders();
  drawPlan();
  go(0);
}

start();
