// The data of the page, the present settings, and the colours.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const { azimuths, first_azimuth_rad: firstAzimuth, columns, column_m: columnM, offset_m: offsetM, scans } = data;
const last = scans.length - 1;
const CIRCLE = 2 * Math.PI;
const MAX_RANGE_M = columns * columnM + offsetM;
const MIN_RANGE_M = 10;
const MAX_PIXELS = 1000; // of the image's side: what a processor without a graphics card draws 30 times a second
const NOISE = data.components.findIndex(([name]) => name === "noise");
const RING_LABEL = 2.62; // angle on the screen at which rings are labelled, clear of the azimuths' labels [rad]
const MIN_BOX_PX = 7; // so that a pedestrian can be seen and pointed at

const state = {
  scan: 0, view: "above", up: "heading", overlay: "off", opacity: 0.85, range: MAX_RANGE_M,
  white: data.full_scale_code, boxes: true, rings: true, obstacles: false, clipped: false, playing: false,
  hovered: null,
};

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const levelColours = Array.from({ length: 256 }, (_, i) => rgb("#" + data.level_colours.slice(6 * i, 6 * i + 6)));

/** An overlay: label of a cell from the three bytes of its truth, colour by label, legend, note below it. */
const OVERLAYS = {
  component: {
    label: (r) => r & 15, colours: data.components.map(([, colour]) => rgb(colour)), bare: NOISE,
    legend: data.component_legend.filter(([name]) => name !== "noise"),
    note: "Strongest contribution to each cell. Ghost: a path of several bounces, shown where none of its surfaces is. Multipath in place: one that shows a surface of its path, as a corner does.",
  },
  class: {
    label: (r, g) => g, colours: data.classes.map(([, colour]) => rgb(colour)), bare: 0,
    legend: data.class_legend, note: "",
  },
  moving: {
    label: (r, g, b) => b, colours: [[0, 0, 0], rgb(data.moving_colour)], bare: 0,
    legend: [["moving", data.moving_colour]], note: "",
  },
  bounces: {
    label: (r) => r >> 4, bare: 0,
    colours: Array.from({ length: 16 }, (_, i) => rgb(data.bounce_colours[Math.min(i, 4)])),
    legend: data.bounce_colours.slice(1).map((colour, i) => [i < 3 ? `${i + 1}` : "4 and more", colour]), note: "",
  },
};
