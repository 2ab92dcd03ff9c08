// What is drawn over the picture as lines: rings, boxes, free range, clipped rows, the car.

const pathOf = (points, side) =>
  points.map(([x, y], i) => `${i ? "L" : "M"}${(x * side).toFixed(1)} ${(y * side).toFixed(1)}`).join("");

function ringStep() {
  const rough = state.reach / 3.2;
  return [1, 2, 5, 10, 20, 25, 50, 100].reduce((best, step) =>
    Math.abs(Math.log(step / rough)) < Math.abs(Math.log(best / rough)) ? step : best);
}

function ringMarks(side) {
  const marks = [], step = ringStep();
  for (let range = step; range < state.reach * 0.99; range += step) {
    if (state.view === "polar") {
      const x = range / state.reach * side;
      marks.push(`<path class="ring" d="M${x} 0V${side}"/><text x="${x}" y="${side - 12}">${range} m</text>`);
    } else {
      const radius = range / (2 * state.reach) * side;
      marks.push(`<circle class="ring" cx="${side / 2}" cy="${side / 2}" r="${radius}"/>`
        + `<text x="${side / 2 + radius * Math.sin(RING_TEXT)}" y="${side / 2 - radius * Math.cos(RING_TEXT)}">${range} m</text>`);
    }
  }
  for (let degrees = 0; degrees < 360; degrees += 30) {
    const azimuth = degrees / 360 * TURN;
    const [near, far] = [onScreen(0, azimuth), onScreen(state.reach, azimuth)];
    marks.push(`<path class="spoke" d="${pathOf([near, far], side)}"/>`);
    if (degrees % 90 === 0) {
      const [x, y] = state.view === "polar" ? [22 / side, azimuth / TURN + 10 / side] : onScreen(state.reach * (1 - 28 / side), azimuth);
      marks.push(`<text x="${x * side}" y="${y * side}">${degrees}°</text>`);
    }
  }
  return marks.join("");
}

/** Corners of a box, no side below `least` metres, and the middle of its front: forward, right [m]. */
function cornersOf(box, least) {
  const length = Math.max(box.length, least), width = Math.max(box.width, least);
  const cosine = Math.cos(box.turn), sine = Math.sin(box.turn);
  return [[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 0]].map(([along, across]) => {
    const x = along * length / 2, y = across * width / 2;
    return [box.forward + cosine * x - sine * y, box.right + sine * x + cosine * y];
  });
}

function boxMarks(side) {
  const least = SMALLEST_BOX_PX / side * state.reach * (state.view === "polar" ? 1 : 2);
  return scan().boxes.filter((box) => Math.hypot(box.forward, box.right) < 1.5 * state.reach).map((box) => {
    const middle = azimuthOf(box.forward, box.right);
    const places = cornersOf(box, least).map(([forward, right]) => // near its middle's azimuth, whatever the turn
      onScreen(Math.hypot(forward, right), middle + wrap(azimuthOf(forward, right) - middle)));
    const centre = onScreen(Math.hypot(box.forward, box.right), middle);
    return `<path class="box${state.hot === box.instance ? " hot" : ""}" data-instance="${box.instance}"`
      + ` d="${pathOf(places.slice(0, 4), side)}Z"/><path class="nose" d="${pathOf([centre, places[4]], side)}"/>`;
  }).join("");
}

/** Outline of what each row sees freely: steps between rows, open where nothing was met. */
function freeOutline(side) {
  const half = Math.PI / azimuths;
  let before = null;
  return scan().first_m.map((range, row) => {
    const within = range !== null && range < state.reach;
    const line = within ? pathOf([-half, half].map((off) => onScreen(range, row / azimuths * TURN + off)), side) : "";
    const joined = within && before !== null ? line.replace("M", "L") : line;
    before = within ? range : null;
    return joined;
  }).join("");
}

function rowMarks(side) {
  const free = state.free ? freeOutline(side) : "";
  const clipped = !state.clipped ? "" : scan().clipped.map((row) => {
    const azimuth = row / azimuths * TURN;
    return pathOf([onScreen(state.reach * 0.965, azimuth), onScreen(state.reach, azimuth)], side);
  }).join("");
  return `<path class="casing" d="${free}"/><path class="free" d="${free}"/><path class="clip" d="${clipped}"/>`;
}

function egoMark(side) {
  if (state.view === "polar") return "";
  const degrees = heading() / TURN * 360;
  return `<path class="ego" d="M0-9 6 7 0 3.5-6 7Z" transform="translate(${side / 2} ${side / 2}) rotate(${degrees})"/>`;
}

function drawMarks() {
  const side = $("stage").clientWidth;
  $("marks").setAttribute("viewBox", `0 0 ${side} ${side}`);
  $("marks").innerHTML = (state.rings ? ringMarks(side) : "") + egoMark(side) + rowMarks(side)
    + (state.boxes ? boxMarks(side) : "");
}
