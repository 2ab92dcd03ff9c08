// Buttons, sliders and keys; the last file, which begins.

const step = (by) => { play(false); go(state.scan + by); };
$("back").addEventListener("click", () => step(-1));
$("forth").addEventListener("click", () => step(1));
$("play").addEventListener("click", () => play(!state.playing));
$("slider").addEventListener("input", (event) => { play(false); go(Number(event.target.value)); });

for (const id of ["boxes", "rings", "free", "clipped"]) {
  $(id).checked = state[id];
  $(id).addEventListener("change", (event) => { state[id] = event.target.checked; draw(); });
}

for (const name of ["view", "up", "overlay"]) {
  for (const button of document.getElementsByName(name)) {
    button.addEventListener("change", () => { state[name] = button.value; chosen(); draw(); });
  }
}

/** Bring the other controls in line with the choices of view and overlay. */
function chosen() {
  for (const button of document.getElementsByName("up")) {
    button.disabled = state.view === "polar" || !data.absolute || !data.path;
  }
  const overlay = OVERLAYS[state.overlay];
  $("legend").innerHTML = !overlay ? "" : overlay.legend.map(([name, colour]) =>
    `<li><i style="background:${plainText(colour)}"></i>${plainText(name)}</li>`).join("");
}

/** Choose the value after the present one of a group of radio buttons. */
function turnOn(name, value) {
  const buttons = [...document.getElementsByName(name)];
  const now = buttons.findIndex((button) => button.checked);
  const next = value ? buttons.find((button) => button.value === value) : buttons[(now + 1) % buttons.length];
  if (!next.disabled && !next.matches(":disabled")) next.click();
}

const reachOf = (share) => NEAREST_REACH_M * (FULL_M / NEAREST_REACH_M) ** share;
const shareOf = (reach) => Math.log(reach / NEAREST_REACH_M) / Math.log(FULL_M / NEAREST_REACH_M);

function setReach(reach) {
  state.reach = Math.min(FULL_M, Math.max(NEAREST_REACH_M, reach));
  $("reach").value = 100 * shareOf(state.reach);
  sliders();
  draw();
}

function sliders() {
  for (const [id, text] of [["opacity", `${Math.round(100 * state.opacity)} %`],
    ["reach", `${state.reach.toFixed(0)} m`], ["white", `${(state.white / 2).toFixed(0)} dB`]]) {
    document.querySelector(`output[for=${id}]`).textContent = text;
    $(id).setAttribute("aria-valuetext", text);
  }
  $("half").textContent = (state.white / 4).toFixed(0);
  $("full").textContent = `${(state.white / 2).toFixed(0)} dB`;
}

$("opacity").addEventListener("input", (event) => { state.opacity = event.target.value / 100; sliders(); draw(); });
$("white").addEventListener("input", (event) => { state.white = 2 * event.target.value; sliders(); draw(); });
$("reach").addEventListener("input", (event) => setReach(reachOf(event.target.value / 100)));
$("stage").addEventListener("wheel", (event) => {
  event.preventDefault();
  setReach(state.reach * Math.exp(Math.max(-60, Math.min(60, event.deltaY)) / 400));
}, { passive: false });

let overlayBefore = "component";
const KEYS = {
  ArrowLeft: () => step(-1), ArrowRight: () => step(1),
  Home: () => step(-scans.length), End: () => step(scans.length),
  " ": () => play(!state.playing),
  o: () => {
    if (state.overlay !== "off") overlayBefore = state.overlay;
    turnOn("overlay", state.overlay === "off" ? overlayBefore : "off");
  },
  b: () => $("boxes").click(), r: () => $("rings").click(), p: () => turnOn("view"), n: () => turnOn("up"),
  "+": () => setReach(state.reach / 1.25), "=": () => setReach(state.reach / 1.25),
  "-": () => setReach(state.reach * 1.25),
};
document.addEventListener("keydown", (event) => {
  const act = KEYS[event.key];
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  // What a focused control does with the key itself comes first, except that the slider's steps are ours.
  const holder = event.target, moves = event.key.startsWith("Arrow") || ["Home", "End"].includes(event.key);
  if (holder.matches("select, input[type=range]:not(#slider), input[type=radio]") && (moves || "+-=".includes(event.key))) return;
  if (event.key === " " && holder.matches("button, summary, select, input[type=checkbox], input[type=radio]")) return;
  event.preventDefault();
  act();
});

// Who uses the mouse wants the keys for the scans: what was clicked lets go of them.
document.addEventListener("click", (event) => {
  if (event.detail && document.activeElement.matches("main input, main button")) document.activeElement.blur();
});

new ResizeObserver(draw).observe($("stage"));

function begin() {
  $("about").textContent = `${scans.length === data.total ? "" : `${scans.length} of `}${data.total} scan${data.total > 1 ? "s" : ""}`
    + ` · ${data.sensor} · ${azimuths} rows, cells of ${(100 * cellM).toFixed(0)} cm`;
  const notes = [
    ...(data.has_truth ? [] : ["This folder has no truth: overlay and boxes are off."]),
    ...(data.path ? [] : ["Nothing tells where the scans were taken: the plan is off."]),
  ];
  $("notes").textContent = notes.join(" ");
  $("notes").hidden = !notes.length;
  $("truth").disabled = !data.has_truth;
  $("slider").max = last;
  $("white").value = state.white / 2;
  $("opacity").value = 100 * state.opacity;
  const bar = $("bar").getContext("2d");
  heat.forEach((colour, i) => { bar.fillStyle = `rgb(${colour})`; bar.fillRect(i, 0, 1, 1); });
  OVERLAYS.component.bare = NOISE; // noise shows the scan as it is
  OVERLAYS.component.legend = data.components.filter((_, id) => id !== NOISE);
  $("movers").open = innerWidth > 760;
  chosen();
  sliders();
  drawPlan();
  go(0);
}

begin();
