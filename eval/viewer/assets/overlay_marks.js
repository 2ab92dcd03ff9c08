// Lines drawn over the image: range rings, boxes, first obstacles, clipped azimuths, the car.

const pathOf = (points, side) =>
  points.map(([x, y], i) => `${i ? "L" : "M"}${(x * side).toFixed(1)} ${(y * side).toFixed(1)}`).join("");

function ringStep() {
  const rough = state.range / 3.2;
  return [1, 2, 5, 10, 20, 25, 50, 100].reduce((best, step) =>
    Math.abs(Math.log(step / rough)) < Math.abs(Math.log(best / rough)) ? step : best);
}

function ringMarks(side) {
  const marks = [], step = ringStep();
  for (let range = step; range < state.range * 0.99; range += step) {
    if (state.view === "polar") {
      const x = range / state.range * side;
      marks.push(`<path class="ring" d="M${x} 0V${side}"/><text x="${x}" y="${side - 12}">${range} m</text>`);
    } else {
      const radius = range / (2 * state.range) * side;
      marks.push(`<circle class="ring" cx="${side / 2}" cy="${side / 2}" r="${radius}"/>`
        + `<text x="${side / 2 + radius * Math.sin(RING_LABEL)}" y="${side / 2 - radius * Math.cos(RING_LABEL)}">${range} m</text>`);
    }
  }
  for (let degrees = 0; degrees < 360; degrees += 30) {
    const azimuth = degrees / 360 * CIRCLE;
    const [near, far] = [onScreen(0, azimuth), onScreen(state.range, azimuth)];
    marks.push(`<path class="spoke" d="${pathOf([near, far], side)}"/>`);
    if (degrees % 90 === 0) {
      const [x, y] = state.view === "polar" ? [22 / side, azimuth / CIRCLE + 10 / side] : onScreen(state.range * (1 - 28 / side), azimuth);
      marks.push(`<text x="${x * side}" y="${y * side}">${degrees}°</text>`);
    }
  }
  return marks.join("");
}

/** Corners of a box, each side at least `least` metres, and the middle of its front: forward, right [m]. */
function cornersOf(box, least) {
  const length = Math.max(box.length_m, least), width = Math.max(box.width_m, least);
  const cosine = Math.cos(box.heading_rad), sine = Math.sin(box.heading_rad);
  return [[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 0]].map(([along, across]) => {
    const x = along * length / 2, y = across * width / 2;
    return [box.forward_m + cosine * x - sine * y, box.right_m + sine * x + cosine * y];
  });
}

function boxMarks(side) {
  const least = MIN_BOX_PX / side * state.range * (state.view === "polar" ? 1 : 2);
  return scan().boxes.filter((box) => Math.hypot(box.forward_m, box.right_m) < 1.5 * state.range).map((box) => {
    const middle = azimuthOf(box.forward_m, box.right_m);
    const places = cornersOf(box, least).map(([forward, right]) => // on the same revolution as its centre
      onScreen(Math.hypot(forward, right), middle + wrap(azimuthOf(forward, right) - middle)));
    const centre = onScreen(Math.hypot(box.forward_m, box.right_m), middle);
    return `<path class="box${state.hovered === box.instance ? " hovered" : ""}" data-instance="${box.instance}"`
      + ` d="${pathOf(places.slice(0, 4), side)}Z"/><path class="nose" d="${pathOf([centre, places[4]], side)}"/>`;
  }).join("");
}

/** Range of the first obstacle of each azimuth as steps, open where there is none. */
function obstacleOutline(side) {
  const half = Math.PI / azimuths;
  let before = null;
  return scan().obstacle_m.map((range, azimuthIndex) => {
    const within = range !== null && range < state.range;
    const line = within ? pathOf([-half, half].map((off) => onScreen(range, directionOf(azimuthIndex) + off)), side) : "";
    const joined = within && before !== null ? line.replace("M", "L") : line;
    before = within ? range : null;
    return joined;
  }).join("");
}

function azimuthMarks(side) {
  const obstacles = state.obstacles ? obstacleOutline(side) : "";
  const clipped = !state.clipped ? "" : scan().clipped.map((azimuthIndex) => {
    const azimuth = directionOf(azimuthIndex);
    return pathOf([onScreen(state.range * 0.965, azimuth), onScreen(state.range, azimuth)], side);
  }).join("");
  return `<path class="casing" d="${obstacles}"/><path class="obstacles" d="${obstacles}"/><path class="clip" d="${clipped}"/>`;
}

function carMark(side) {
  if (state.view === "polar") return "";
  const degrees = heading() / CIRCLE * 360;
  return `<path class="car" d="M0-9 6 7 0 3.5-6 7Z" transform="translate(${side / 2} ${side / 2}) rotate(${degrees})"/>`;
}

function drawMarks() {
  const side = $("stage").clientWidth;
  $("marks").setAttribute("viewBox", `0 0 ${side} ${side}`);
  $("marks").innerHTML = (state.rings ? ringMarks(side) : "") + carMark(side) + azimuthMarks(side)
    + (state.boxes ? boxMarks(side) : "");
}
