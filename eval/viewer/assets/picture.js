// From a scan to pixels. Frames as in docs/conventions.md: azimuth clockwise from ahead, yaw in the world
// counter-clockwise from east.

// ---- geometry

const scan = () => scans[state.scan];

/** Heading on the screen, clockwise from up [rad]. */
const heading = () =>
  state.up === "north" && state.view === "above" && scan().pose ? Math.PI / 2 - scan().pose[2] : 0;

const wrap = (angle) => angle - TURN * Math.round(angle / TURN);
const azimuthOf = (forward, right) => (Math.atan2(right, forward) + TURN) % TURN;

/** Screen place, in units of the stage's side, of a range and an azimuth (any turn of it). */
function onScreen(range, azimuth) {
  if (state.view === "polar") return [range / state.reach, azimuth / TURN];
  const angle = azimuth + heading(), radius = range / (2 * state.reach);
  return [0.5 + radius * Math.sin(angle), 0.5 - radius * Math.cos(angle)];
}

/** Range [m] and azimuth [rad] of a screen place in units of the stage's side. */
function fromScreen(x, y) {
  if (state.view === "polar") return [x * state.reach, y * TURN];
  const right = (x - 0.5) * 2 * state.reach, forward = (0.5 - y) * 2 * state.reach;
  return [Math.hypot(right, forward), (azimuthOf(forward, right) - heading() + 2 * TURN) % TURN];
}

const rowOf = (azimuth) => Math.round(azimuth / TURN * azimuths) % azimuths;

/** For every pixel the fractional row (heading not yet taken off) and column of its middle. */
let places = { key: "" };
function pixelPlaces(side) {
  const key = `${side} ${state.view} ${state.reach}`;
  if (places.key === key) return places;
  const row = new Float32Array(side * side), column = new Float32Array(side * side);
  for (let j = 0, p = 0; j < side; j++) {
    for (let i = 0; i < side; i++, p++) {
      let range, azimuth;
      if (state.view === "polar") {
        range = (i + 0.5) / side * state.reach;
        azimuth = (j + 0.5) / side * TURN;
      } else {
        const right = (i - (side - 1) / 2) * 2 * state.reach / side;
        const forward = ((side - 1) / 2 - j) * 2 * state.reach / side;
        range = Math.hypot(right, forward);
        azimuth = azimuthOf(forward, right);
      }
      row[p] = azimuth / TURN * azimuths;
      column[p] = (range - offsetM) / cellM - 0.5;
    }
  }
  places = { key, row, column };
  return places;
}

// ---- the picture

let shown = null; // what is unpacked of the scan on the screen

function paint() {
  const side = Math.min(LARGEST_BUFFER, Math.max(64, Math.round($("stage").clientWidth * devicePixelRatio)));
  const canvas = $("picture");
  if (canvas.width !== side) canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  project(side, new Uint32Array(image.data.buffer));
  context.putImageData(image, 0, 0);
}

/** Colours of every code, for plain cells and by label for overlaid ones; little-endian ABGR words. */
function palette(overlay) {
  const word = ([r, g, b]) => (255 << 24 | Math.round(b) << 16 | Math.round(g) << 8 | Math.round(r)) >>> 0;
  const light = (code) => Math.min(1, code / state.white);
  const plain = Uint32Array.from({ length: 256 }, (_, code) => word(heat[Math.round(255 * light(code))]));
  if (!overlay) return { plain, tinted: null };
  const tinted = new Uint32Array(256 * overlay.colours.length);
  overlay.colours.forEach((colour, label) => {
    for (let code = 0; code < 256; code++) {
      const level = Math.min(1, 0.2 + 0.9 * light(code)), under = heat[Math.round(255 * light(code))];
      const share = label === overlay.bare ? 0 : state.opacity;
      const page = heat[0];
      tinted[256 * label + code] = word(colour.map(
        (value, i) => (1 - share) * under[i] + share * (page[i] + (value - page[i]) * level)));
    }
  });
  return { plain, tinted };
}

/** Fill `words` (side * side) with the scan: codes interpolated in azimuth and range, labels the nearest. */
function project(side, words) {
  const { row, column } = pixelPlaces(side);
  const overlay = shown.truth ? OVERLAYS[state.overlay] : null;
  const { plain, tinted } = palette(overlay);
  const { codes, truth } = shown;
  const turned = (azimuths - heading() / TURN * azimuths % azimuths) % azimuths;
  for (let p = 0; p < words.length; p++) {
    const c = column[p];
    if (c > columns - 0.5) continue; // beyond the last cell: transparent
    let r = row[p] + turned;
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
