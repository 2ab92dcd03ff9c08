// Text: facts of the scan, the list of moving objects, the cell or box under the pointer.

const kmh = (speed) => `${(3.6 * speed).toFixed(1)} km/h`;
const degrees = (angle) => `${(angle / CIRCLE * 360).toFixed(1)}°`;
const signed = (value, digits, unit) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)} ${unit}`;

function drawFacts() {
  const { number, stamp_us: stamp, speed_m_s: speed, yaw_rate_rad_s: rate, motion, clipped, pose } = scan();
  const rows = [
    ["scan", `${number + 1} of ${data.total}`],
    ["time", `${((stamp - scans[0].stamp_us) / 1e6).toFixed(3)} s`],
    ["time stamp", `${stamp} µs`],
    ["speed", speed === null ? "–" : kmh(speed)],
    ["yaw rate", rate === null ? "–" : signed(rate / CIRCLE * 360, 1, "°/s")],
    ["since last scan", `x ${motion === null ? "–" : signed(motion[0], 3, "m")}`],
    ["", `y ${motion === null ? "–" : signed(motion[1], 3, "m")}`],
    ["", `yaw ${motion === null ? "–" : signed(motion[2] / CIRCLE * 360, 2, "°")}`],
    ["position", pose === null ? "–" : `${pose[0].toFixed(1)}, ${pose[1].toFixed(1)} m`],
    ...(data.has_truth ? [["saturated azimuths", `${clipped.length} of ${azimuths}`]] : []),
  ];
  $("facts").innerHTML = rows
    .map(([name, value]) => `<dt>${name}</dt><dd>${value}</dd>`).join("");
}

function drawMovers() {
  const boxes = [...scan().boxes].sort((a, b) =>
    Math.hypot(a.forward_m, a.right_m) - Math.hypot(b.forward_m, b.right_m));
  $("movers").hidden = !data.has_truth;
  $("count").textContent = `(${boxes.length})`;
  $("rows").innerHTML = boxes.map((box) => `<tr data-instance="${box.instance}"><td>${box.instance}</td>`
    + `<td>${plainText(className(box.class_id))}</td><td>${Math.hypot(box.forward_m, box.right_m).toFixed(1)} m</td>`
    + `<td>${degrees(azimuthOf(box.forward_m, box.right_m))}</td><td>${kmh(box.speed_m_s)}</td></tr>`).join("");
}

const plainText = (text) => text.replace(/[&<>"]/g, (letter) => `&#${letter.charCodeAt(0)};`);
const className = (id) => (data.classes[id] || [`class ${id}`])[0].replaceAll("_", " ");

const boxText = (box) => `${className(box.class_id)} ${box.instance} · ${kmh(box.speed_m_s)} · ${box.length_m} × ${box.width_m} × ${box.height_m} m`
  + ` · at ${Math.hypot(box.forward_m, box.right_m).toFixed(1)} m, ${degrees(azimuthOf(box.forward_m, box.right_m))}`;

function cellText(range, azimuth) {
  const index = azimuthIndexOf(azimuth), column = Math.max(0, Math.floor((range - offsetM) / columnM));
  if (column >= columns) return "beyond the last range bin";
  const at = index * columns + column, code = shown.codes[at];
  const words = [`${range.toFixed(1)} m`, `${degrees(azimuth)} (azimuth ${index})`, `code ${code} ≈ ${(code / 2).toFixed(1)} dB`];
  if (shown.truth) {
    const [r, g, b] = shown.truth.subarray(4 * at, 4 * at + 3);
    words.push((data.components[r & 15] || ["?"])[0]);
    if (g) words.push(className(g));
    if (r >> 4) words.push(`${r >> 4} bounce${r >> 4 > 1 ? "s" : ""}`);
    if (b) words.push("moving");
    if (state.clipped && scan().clipped.includes(index)) words.push("azimuth saturated");
  }
  return words.join(" · ");
}

let pointer = null; // position of the pointer on the stage, in units of its side

function drawReadout() {
  const box = scan().boxes.find((each) => each.instance === state.hovered);
  if (box) $("readout").textContent = boxText(box);
  else if (pointer && shown) $("readout").textContent = cellText(...fromScreen(...pointer));
  else $("readout").textContent = "Point at a cell or a box to read its values.";
}

function highlight(instance) {
  if (state.hovered === instance) return;
  state.hovered = instance;
  for (const element of document.querySelectorAll("[data-instance]")) {
    element.classList.toggle("hovered", Number(element.dataset.instance) === instance);
  }
}

for (const id of ["stage", "plan", "movers"]) {
  $(id).addEventListener("pointermove", (event) => {
    const holder = event.target.closest("[data-instance]");
    highlight(holder ? Number(holder.dataset.instance) : null);
    if (id === "stage") {
      const frame = $("stage").getBoundingClientRect();
      pointer = [(event.clientX - frame.left) / frame.width, (event.clientY - frame.top) / frame.height];
    }
    drawReadout();
  });
  $(id).addEventListener("pointerleave", (event) => {
    if (event.pointerType === "touch") return; // after a touch the values stay
    pointer = null;
    highlight(null);
    drawReadout();
  });
}
