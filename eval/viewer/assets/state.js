// The page's data, what is chosen at present, and the colours.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const { azimuths, columns, cell_m: cellM, offset_m: offsetM, scans } = data;
const last = scans.length - 1;
const TURN = 2 * Math.PI;
const FULL_M = columns * cellM + offsetM;
const NEAREST_REACH_M = 10;
const LARGEST_BUFFER = 1000; // pixels a side: what a processor without a graphics card projects 30 times a second
const NOISE = data.components.findIndex(([name]) => name === "noise");
const BOUNCES = ["#39424e", "#59d0ff", "#ffc14d", "#ff5fa2", "#b07cff"];
const MOVING = "#ff5a4f";
const RING_TEXT = 2.62; // angle on the screen at which rings are labelled, clear of the azimuths' labels [rad]
const SMALLEST_BOX_PX = 7; // so that a pedestrian can be seen and pointed at

const state = {
  scan: 0, view: "above", up: "heading", overlay: "off", opacity: 0.85, reach: FULL_M,
  white: data.brightest, boxes: true, rings: true, free: false, clipped: false, playing: false, hot: null,
};

const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const heat = Array.from({ length: 256 }, (_, i) => rgb("#" + data.heat.slice(6 * i, 6 * i + 6)));

/** What an overlay says of a cell: its label from the truth's three bytes, a colour by label, a legend. */
const OVERLAYS = {
  component: {
    label: (r) => r & 15, colours: data.components.map(([, colour]) => rgb(colour)), bare: -1,
    legend: data.components,
  },
  class: {
    label: (r, g) => g, colours: data.classes.map(([, colour]) => rgb(colour)), bare: 0,
    legend: data.groups,
  },
  moving: {
    label: (r, g, b) => b, colours: [[0, 0, 0], rgb(MOVING)], bare: 0, legend: [["moving", MOVING]],
  },
  bounces: {
    label: (r) => r >> 4, colours: Array.from({ length: 16 }, (_, i) => rgb(BOUNCES[Math.min(i, 4)])), bare: 0,
    legend: BOUNCES.slice(1).map((colour, i) => [i < 3 ? `${i + 1}` : "4 and more", colour]),
  },
};
