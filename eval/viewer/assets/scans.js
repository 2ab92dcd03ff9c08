// Scans, decoded when first shown. They stay polar, (azimuths, columns), so that every pixel has its cell.

const decoded = new Map();
const KEPT = 24;

function bytes(base64) {
  const text = atob(base64), content = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) content[i] = text.charCodeAt(i);
  return content;
}

async function pixels(base64) {
  const blob = new Blob([bytes(base64)], { type: "image/webp" });
  const image = await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const canvas = document.createElement("canvas");
  canvas.width = image.width;
  canvas.height = image.height;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, image.width, image.height).data;
}

async function decode(index) {
  if (!decoded.has(index)) {
    if (decoded.size >= KEPT) decoded.delete(decoded.keys().next().value);
    decoded.set(index, (async () => {
      const { codes, labels } = scans[index];
      const [grey, truth] = await Promise.all([pixels(codes), labels ? pixels(labels) : null]);
      const levels = new Uint8Array(azimuths * columns);
      for (let i = 0; i < levels.length; i++) levels[i] = grey[4 * i];
      return { codes: levels, truth };
    })());
  }
  return decoded.get(index);
}
