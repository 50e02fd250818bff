/** One picture on one page, as PDF: its pixels as they are, packed without loss. ISO 32000-1, 7.3 to 7.5 and 8.9. */

const POINTS_PER_PX = 72 / 96;

/** The bytes of a page with a picture all over it; `width` and `height` of the page are in pixels of style sheets. */
export async function pdfOf(
  picture: ImageData,
  page: { width: number; height: number },
  title: string,
): Promise<Blob> {
  const pixels = await deflated(withoutAlpha(picture));
  const [width, height] = [page.width * POINTS_PER_PX, page.height * POINTS_PER_PX].map((n) => n.toFixed(2));
  const drawing = `q ${width} 0 0 ${height} 0 0 cm /Map Do Q`;
  const image = `<< /Type /XObject /Subtype /Image /Width ${picture.width} /Height ${picture.height} /ColorSpace /DeviceRGB /BitsPerComponent 8 /Filter /FlateDecode /Length ${pixels.byteLength} >>`;
  return assembled([
    ["<< /Type /Catalog /Pages 2 0 R >>"],
    ["<< /Type /Pages /Kids [3 0 R] /Count 1 >>"],
    [
      `<< /Type /Page /Parent 2 0 R /MediaBox [0 0 ${width} ${height}] /Contents 4 0 R /Resources << /XObject << /Map 5 0 R >> >> >>`,
    ],
    [`<< /Length ${drawing.length} >>\nstream\n${drawing}\nendstream`],
    [`${image}\nstream\n`, pixels, "\nendstream"],
    [`<< /Title ${textString(title)} /Producer (bathyfleet) >>`],
  ]);
}

type Part = string | Uint8Array<ArrayBuffer>;

/** Objects with their numbers, the table of where each begins, and the trailer. */
function assembled(objects: readonly (readonly Part[])[]): Blob {
  const parts: Part[] = [];
  let length = 0;
  const add = (part: Part) => {
    parts.push(part);
    length += part.length;
  };
  add("%PDF-1.4\n");
  const begins = objects.map((object, i) => {
    const begin = length;
    add(`${i + 1} 0 obj\n`);
    for (const part of object) add(part);
    add("\nendobj\n");
    return begin;
  });
  const table = length;
  const rows = begins.map((at) => `${String(at).padStart(10, "0")} 00000 n \n`).join("");
  const size = objects.length + 1;
  add(`xref\n0 ${size}\n0000000000 65535 f \n${rows}`);
  add(`trailer\n<< /Size ${size} /Root 1 0 R /Info ${objects.length} 0 R >>\nstartxref\n${table}\n%%EOF\n`);
  return new Blob(parts, { type: "application/pdf" });
}

/** Any text as PDF takes it: UTF-16 in hexadecimal digits. */
const textString = (text: string) =>
  `<FEFF${[...Array(text.length).keys()].map((i) => text.charCodeAt(i).toString(16).padStart(4, "0")).join("")}>`;

/** On white. */
function withoutAlpha({ data, width, height }: ImageData): Uint8Array<ArrayBuffer> {
  const rgb = new Uint8Array(3 * width * height);
  for (let from = 0, to = 0; to < rgb.length; from += 4, to += 3) {
    const alpha = (data[from + 3] ?? 255) / 255;
    for (let k = 0; k < 3; k++) rgb[to + k] = (data[from + k] ?? 0) * alpha + 255 * (1 - alpha);
  }
  return rgb;
}

async function deflated(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array<ArrayBuffer>> {
  const packed = new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate"));
  return new Uint8Array(await new Response(packed).arrayBuffer());
}
