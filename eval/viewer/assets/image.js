// The scan as an image. Frames as in docs/conventions.md: azimuth clockwise from ahead, yaw in the world
// counter-clockwise from east.

// ---- geometry

const scan = () => scans[state.scan];

/** Heading on the screen, clockwise from up [rad]. */
const heading = () =>
  state.up === "north" && state.view === "above" && scan().pose ? Math.PI / 2 - scan().pose[2] : 0;

const wrap = (angle) => angle - CIRCLE * Math.round(angle / CIRCLE);
const azimuthOf = (forward, right) => (Math.atan2(right, forward) + CIRCLE) % CIRCLE;

/** Position on the screen, in units of the stage's side, of a range and an azimuth (of any revolution). */
function onScreen(range, azimuth) {
  if (state.view === "polar") return [range / state.range, azimuth / CIRCLE];
  const angle = azimuth + heading(), radius = range / (2 * state.range);
  return [0.5 + radius * Math.sin(angle), 0.5 - radius * Math.cos(angle)];
}

/** Range [m] and azimuth [rad] of a position on the screen in units of the stage's side. */
function fromScreen(x, y) {
  if (state.view === "polar") return [x * state.range, y * CIRCLE];
  const right = (x - 0.5) * 2 * state.range, forward = (0.5 - y) * 2 * state.range;
  return [Math.hypot(right, forward), (azimuthOf(forward, right) - heading() + 2 * CIRCLE) % CIRCLE];
}

/** Direction in which an azimuth looks, by its number [rad], and the number of the one nearest to a direction. */
const directionOf = (index) => firstAzimuth + index / azimuths * CIRCLE;
const azimuthIndexOf = (azimuth) => (Math.round((azimuth - firstAzimuth) / CIRCLE * azimuths) + azimuths) % azimuths;

/** Direction in azimuth steps (before heading and first azimuth are subtracted) and column of every pixel's centre. */
let pixelGrid = { key: "" };
function gridOf(side) {
  const key = `${side} ${state.view} ${state.range}`;
  if (pixelGrid.key === key) return pixelGrid;
  const row = new Float32Array(side * side), column = new Float32Array(side * side);
  for (let j = 0, p = 0; j < side; j++) {
    for (let i = 0; i < side; i++, p++) {
      let range, azimuth;
      if (state.view === "polar") {
        range = (i + 0.5) / side * state.range;
        azimuth = (j + 0.5) / side * CIRCLE;
      } else {
        const right = (i - (side - 1) / 2) * 2 * state.range / side;
        const forward = ((side - 1) / 2 - j) * 2 * state.range / side;
        range = Math.hypot(right, forward);
        azimuth = azimuthOf(forward, right);
      }
      row[p] = azimuth / CIRCLE * azimuths;
      column[p] = (range - offsetM) / columnM - 0.5;
    }
  }
  pixelGrid = { key, row, column };
  return pixelGrid;
}

// ---- the image

let shown = null; // the decoded scan on the screen

function paint() {
  const side = Math.min(MAX_PIXELS, Math.max(64, Math.round($("stage").clientWidth * devicePixelRatio)));
  const canvas = $("image");
  if (canvas.width !== side) canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  project(side, new Uint32Array(image.data.buffer));
  context.putImageData(image, 0, 0);
}

/** Colours of every code, without an overlay and by label with one; little-endian ABGR words. */
function palette(overlay) {
  const word = ([r, g, b]) => (255 << 24 | Math.round(b) << 16 | Math.round(g) << 8 | Math.round(r)) >>> 0;
  const light = (code) => Math.min(1, code / state.white);
  const plain = Uint32Array.from({ length: 256 }, (_, code) => word(levelColours[Math.round(255 * light(code))]));
  if (!overlay) return { plain, tinted: null };
  const tinted = new Uint32Array(256 * overlay.colours.length);
  overlay.colours.forEach((colour, label) => {
    for (let code = 0; code < 256; code++) {
      const level = Math.min(1, 0.2 + 0.9 * light(code)), under = levelColours[Math.round(255 * light(code))];
      const share = label === overlay.bare ? 0 : state.opacity;
      const page = levelColours[0];
      tinted[256 * label + code] = word(colour.map(
        (value, i) => (1 - share) * under[i] + share * (page[i] + (value - page[i]) * level)));
    }
  });
  return { plain, tinted };
}

/** Fill `words` (side * side) with the scan: codes interpolated in azimuth and range, labels of the nearest cell. */
function project(side, words) {
  const { row, column } = gridOf(side);
  const overlay = shown.truth ? OVERLAYS[state.overlay] : null;
  const { plain, tinted } = palette(overlay);
  const { codes, truth } = shown;
  const turns = (heading() + firstAzimuth) / CIRCLE;
  const rotated = (Math.ceil(turns) - turns) * azimuths;
  for (let p = 0; p < words.length; p++) {
    const c = column[p];
    if (c > columns - 0.5) continue; // beyond the last range bin: transparent
    let r = row[p] + rotated;
    if (r >= azimuths) r -= azimuths;
    const r0 = r | 0, u = r - r0, above = r0 % azimuths * columns, below = (r0 + 1) % azimuths * columns;
    const c0 = Math.max(0, c | 0), c1 = Math.min(columns - 1, c0 + 1), v = Math.max(0, c - c0);
    const code = (1 - u) * ((1 - v) * codes[above + c0] + v * codes[above + c1])
      + u * ((1 - v) * codes[below + c0] + v * codes[below + c1]) + 0.5 | 0;
    if (tinted) {
      const at = 4 * ((u < 0.5 ? above : below) + (v < 0.5 ? c0 : c1));
      words[p] = tinted[256 * overlay.label(truth[at], truth[at + 1], truth[at + 2]) + code];
    } else words[p] = plain[code];
  }
}
