// Numbers as text in the notation of the page's language, which the server chose: what the browser's language is does
// not count. Plain text has a hyphen and a point, as the server and JSON write numbers.
//
// A typed text is a number only if it is what the panel writes for that number, up to thousands separators, trailing
// zeros, a plus sign and the width of its characters. app/i18n/typed_numbers.py has the same rule.
import { scaled } from "./decimals.js";

const { decimal = ".", group = "," } = document.documentElement.dataset;
export const DECIMAL = decimal;
export const MINUS = "−";
const SEPARATOR = DECIMAL === "," ? ";" : ",";

const LONGEST = 40;
const AROUND = /^[ \t\r\n\u00a0\u3000]+|[ \t\r\n\u00a0\u3000]+$/g;
const PLAIN = /^([-+]?)((?:0|[1-9]\d*|[1-9]\d{0,2}(?:,\d{3})+)(?:\.\d+)?(?:e[-+]\d{2,3})?)$/;
const WHOLE = /^(-?\d+)(?:\.0+)?$/;
// A comma that may separate thousands or values.
const UNCLEAR = /\d,\d{3}(?!\d)/;
// Separators of thousands that look alike: a keyboard has only one of each.
const ALIKE = ["\u202f\u00a0 ", "’'"];
const SIGNS = signs();

// What each character stands for; a separator of another language stands for none.
function signs() {
  const own = new Map([
    [DECIMAL, "."],
    [MINUS, "-"],
  ]);
  for (const sign of ALIKE.find((alike) => alike.includes(group)) ?? group) if (!own.has(sign)) own.set(sign, ",");
  const all = new Map([[".", "?"], [",", "?"], ...own]);
  for (const sign of "0123456789+-") all.set(sign, sign);
  for (const [sign, read] of [...all]) if (sign < "~") all.set(String.fromCharCode(sign.charCodeAt(0) + 0xfee0), read);
  return all;
}

/** @param {string} plain */
export function numberText(plain) {
  return plain.replaceAll("-", MINUS).replace(".", DECIMAL);
}

// A number as plain text, as Python writes it.
/** @param {number} value */
export function plainText(value) {
  const [digits, exponent] = value.toExponential().split("e");
  if (value === 0 || (Number(exponent) >= -4 && Number(exponent) < 16)) return String(value);
  return `${digits}e${exponent[0]}${exponent.slice(1).padStart(2, "0")}`;
}

// The typed number as plain text, null if it is not one. A whole number may have any size.
/** @param {string} text @param {boolean} isWhole */
export function readPlain(text, isWhole) {
  const plain = plainOf(text);
  if (plain === null) return null;
  if (isWhole) {
    const whole = WHOLE.exec(plain);
    return whole && String(BigInt(whole[1]));
  }
  const value = Number(plain) + 0; // no negative zero
  if (!Number.isFinite(value)) return null;
  const shown = plainText(value);
  return (plain.includes("e") ? plain === shown : isEqual(plain, shown)) ? shown : null;
}

/** @param {string} text */
function plainOf(text) {
  const typed = text.replace(AROUND, "");
  if (typed.length > LONGEST) return null;
  const match = PLAIN.exec(Array.from(typed, (sign) => SIGNS.get(sign) ?? (sign === "e" ? sign : "?")).join(""));
  return match && match[1].replace("+", "") + match[2].replaceAll(",", "");
}

/** @param {string} one @param {string} other */
function isEqual(one, other) {
  const [[first, second]] = scaled(one, other);
  return first === second;
}

// What a press sends for a typed number: a number, or text if it is not exact here; null if it is not a number.
/** @param {string} text @param {boolean} isWhole */
export function readNumber(text, isWhole) {
  const plain = readPlain(text, isWhole);
  if (plain === null) return null;
  const value = Number(plain);
  return isWhole && (Math.abs(value) > 2 ** 53 || BigInt(value) !== BigInt(plain)) ? plain : value;
}

// The elements of a list of numbers, as they are typed; null where it is not clear what a comma separates.
/** @param {string} text */
export function elementsOf(text) {
  if (!text.replace(AROUND, "")) return [];
  if (SEPARATOR === "," && UNCLEAR.test(text)) return null;
  return text.split(SEPARATOR).map((element) => element.replace(AROUND, ""));
}

// The numbers of a list; an element that is not a number is its text, which the server refuses.
/** @param {string} text @param {boolean} isWhole */
export function readNumbers(text, isWhole) {
  return elementsOf(text)?.map((element) => readNumber(element, isWhole) ?? element) ?? [text];
}

/** @param {string[]} plains */
export function listText(plains) {
  return plains.map(numberText).join(`${SEPARATOR} `);
}
