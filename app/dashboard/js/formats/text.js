/** The text of a file, whatever it was written with. */

import { t } from "../texts.js";
import { FormatError } from "./error.js";

const MARKS = [
  { encoding: "utf-16le", bytes: [0xff, 0xfe] },
  { encoding: "utf-16be", bytes: [0xfe, 0xff] },
];
const LOOKED_AT = 400;

/**
 * Decode UTF-8, UTF-16 and, where it is neither, Windows-1252.
 * @param {Uint8Array} bytes
 * @returns {{text: string, notices: string[]}} without a byte order mark
 * @throws {FormatError} where it is no text
 */
export function textOf(bytes) {
  const notices = [];
  let text;
  const wide = MARKS.find((mark) => mark.bytes.every((byte, at) => bytes[at] === byte))?.encoding ?? unmarked(bytes);
  if (wide) text = new TextDecoder(wide).decode(bytes);
  else {
    try {
      text = new TextDecoder("utf-8", { fatal: true }).decode(bytes);
    } catch {
      text = new TextDecoder("windows-1252").decode(bytes);
      notices.push(t("It is not UTF-8 and was read as Windows-1252: check the names"));
    }
  }
  if (text.includes("\0")) throw new FormatError(t("this is no text in UTF-8, UTF-16 or Windows-1252"));
  text = text.replace(/^\uFEFF/, "");
  if (/^\s*<[?!a-z]/i.test(text)) throw new FormatError(t("this is XML, as KML, GPX and web pages are: save it as GeoJSON or CSV"));
  return { text, notices };
}

/** UTF-16 without a mark: every second byte of plain text is zero. */
function unmarked(bytes) {
  const first = bytes.subarray(0, LOOKED_AT);
  const zeros = [0, 0];
  first.forEach((byte, at) => { if (byte === 0) zeros[at % 2] += 1; });
  if (zeros[1] > first.length / 4 && zeros[0] === 0) return "utf-16le";
  if (zeros[0] > first.length / 4 && zeros[1] === 0) return "utf-16be";
  return null;
}
