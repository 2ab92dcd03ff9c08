// The plan, in metres with y down: the town, the drive, moving objects; a click goes to the nearest scan.

const onPlan = ([x, y]) => [x - data.window[0], data.window[3] - y];

function drawPlan() {
  if (!data.window) {
    $("where").hidden = true;
    return;
  }
  const width = data.window[2] - data.window[0], pixel = width / 350;
  const drive = data.path.map((pose) => onPlan(pose).map((v) => v.toFixed(2)).join(",")).join(" ");
  const bar = [500, 200, 100, 50, 20, 10].find((length) => length < 0.3 * width);
  const [right, low] = [width - 12 * pixel, width - 12 * pixel];
  $("plan").setAttribute("viewBox", `0 0 ${width} ${width}`);
  $("plan").innerHTML =
    (data.plan ? `<image href="data:image/webp;base64,${data.plan}" width="${width}" height="${width}"/>` : "")
    + `<polyline class="under" stroke-width="6" points="${drive}"/><polyline class="drive" stroke-width="2.5" points="${drive}"/>`
    + `<path class="measure" stroke-width="2" d="M${right - bar} ${low}H${right}"/>`
    + `<text x="${right - bar / 2}" y="${low - 5 * pixel}" font-size="${10.5 * pixel}" text-anchor="middle">${bar} m</text>`
    + `<text x="${12 * pixel}" y="${20 * pixel}" font-size="${10.5 * pixel}">${data.north_up ? "N ↑" : "start ↑"}</text>`
    + `<g id="now"></g>`;
}

function drawNow() {
  if (!data.window) return;
  const { pose, boxes } = scan();
  const pixel = (data.window[2] - data.window[0]) / 350;
  if (!pose) {
    $("now").innerHTML = "";
    return;
  }
  const [x, y] = onPlan(pose), heading = (Math.PI / 2 - pose[2]) / CIRCLE * 360;
  const movers = !state.boxes ? "" : boxes.map((box) => {
    const cosine = Math.cos(box.yaw_rad), sine = Math.sin(box.yaw_rad);
    const [along, across] = [Math.max(box.length_m, 4 * pixel) / 2, Math.max(box.width_m, 4 * pixel) / 2];
    const corners = [[1, 1], [1, -1], [-1, -1], [-1, 1]].map(([a, b]) => onPlan(
      [box.x_m + a * along * cosine - b * across * sine, box.y_m + a * along * sine + b * across * cosine]));
    return `<polygon class="mover${state.hovered === box.instance ? " hovered" : ""}" data-instance="${box.instance}"`
      + ` points="${corners.map((corner) => corner.map((v) => v.toFixed(2)).join(",")).join(" ")}"/>`;
  }).join("");
  $("now").innerHTML = `<circle class="view-range" cx="${x}" cy="${y}" r="${state.range}"/>` + movers
    + `<path class="here" d="M0-10 6.5 7 0 3.5-6.5 7Z" transform="translate(${x} ${y}) rotate(${heading}) scale(${pixel})"/>`;
}

$("plan").addEventListener("click", (event) => {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform($("plan").getScreenCTM().inverse());
  const distance = (index) => {
    if (!scans[index].pose) return Infinity;
    const [x, y] = onPlan(scans[index].pose);
    return Math.hypot(x - point.x, y - point.y);
  };
  go(scans.reduce((best, _, index) => distance(index) < distance(best) ? index : best, 0));
});
