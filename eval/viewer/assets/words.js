// What is said in words: facts of the scan, the list of movers, the cell or box under the pointer.

const kmh = (speed) => `${(3.6 * speed).toFixed(1)} km/h`;
const degrees = (angle) => `${(angle / TURN * 360).toFixed(1)}°`;
const signed = (value, digits, unit) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)} ${unit}`;

function facts() {
  const { number, stamp_us: stamp, speed, yaw_rate: rate, motion, clipped, pose } = scan();
  const rows = [
    ["scan", `${number + 1} of ${data.total}`],
    ["time", `${((stamp - scans[0].stamp_us) / 1e6).toFixed(3)} s`],
    ["stamp", `${stamp} µs`],
    ["speed", speed === null ? "–" : kmh(speed)],
    ["yaw rate", rate === null ? "–" : signed(rate / TURN * 360, 1, "°/s")],
    ["since last scan", `x ${motion === null ? "–" : signed(motion[0], 3, "m")}`],
    ["", `y ${motion === null ? "–" : signed(motion[1], 3, "m")}`],
    ["", `yaw ${motion === null ? "–" : signed(motion[2] / TURN * 360, 2, "°")}`],
    ["position", pose === null ? "–" : `${pose[0].toFixed(1)}, ${pose[1].toFixed(1)} m`],
    ...(data.has_truth ? [["clipped rows", `${clipped.length} of ${azimuths}`]] : []),
  ];
  $("facts").innerHTML = rows
    .map(([name, value]) => `<dt>${name}</dt><dd>${value}</dd>`).join("");
}

function moverRows() {
  const boxes = [...scan().boxes].sort((a, b) =>
    Math.hypot(a.forward, a.right) - Math.hypot(b.forward, b.right));
  $("movers").hidden = !data.has_truth;
  $("count").textContent = `(${boxes.length})`;
  $("rows").innerHTML = boxes.map((box) => `<tr data-instance="${box.instance}"><td>${box.instance}</td>`
    + `<td>${plainText(className(box.class_id))}</td><td>${Math.hypot(box.forward, box.right).toFixed(1)} m</td>`
    + `<td>${degrees(azimuthOf(box.forward, box.right))}</td><td>${kmh(box.speed)}</td></tr>`).join("");
}

const plainText = (text) => text.replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
const className = (id) => (data.classes[id] || [`class ${id}`])[0].replaceAll("_", " ");

const boxWords = (box) => `${className(box.class_id)} ${box.instance} · ${kmh(box.speed)} · ${box.length} × ${box.width} × ${box.height} m`
  + ` · at ${Math.hypot(box.forward, box.right).toFixed(1)} m, ${degrees(azimuthOf(box.forward, box.right))}`;

function cellWords(range, azimuth) {
  const row = rowOf(azimuth), column = Math.max(0, Math.floor((range - offsetM) / cellM));
  if (column >= columns) return "beyond the last cell";
  const at = row * columns + column, code = shown.codes[at];
  const words = [`${range.toFixed(1)} m`, `${degrees(azimuth)} (row ${row})`, `code ${code} ≈ ${(code / 2).toFixed(1)} dB`];
  if (shown.truth) {
    const [r, g, b] = shown.truth.subarray(4 * at, 4 * at + 3);
    words.push((data.components[r & 15] || ["?"])[0]);
    if (g) words.push(className(g));
    if (r >> 4) words.push(`${r >> 4} bounce${r >> 4 > 1 ? "s" : ""}`);
    if (b) words.push("moving");
    if (state.clipped && scan().clipped.includes(row)) words.push("row clipped");
  }
  return words.join(" · ");
}

let pointer = null; // where the pointer rests on the stage, in units of its side

function probe() {
  const box = scan().boxes.find((each) => each.instance === state.hot);
  if (box) $("probe").textContent = boxWords(box);
  else if (pointer && shown) $("probe").textContent = cellWords(...fromScreen(...pointer));
  else $("probe").textContent = "Point at a cell or a box to read it.";
}

function heatUp(instance) {
  if (state.hot === instance) return;
  state.hot = instance;
  for (const element of document.querySelectorAll("[data-instance]")) {
    element.classList.toggle("hot", Number(element.dataset.instance) === instance);
  }
}

for (const id of ["stage", "plan", "movers"]) {
  $(id).addEventListener("pointermove", (event) => {
    const holder = event.target.closest("[data-instance]");
    heatUp(holder ? Number(holder.dataset.instance) : null);
    if (id === "stage") {
      const frame = $("stage").getBoundingClientRect();
      pointer = [(event.clientX - frame.left) / frame.width, (event.clientY - frame.top) / frame.height];
    }
    probe();
  });
  $(id).addEventListener("pointerleave", (event) => {
    if (event.pointerType === "touch") return; // a finger lifted: what it read stays
    pointer = null;
    heatUp(null);
    probe();
  });
}
