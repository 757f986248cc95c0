// Numbers as text, and calculated as text: what is typed, in the notation of the page's language.
// Decimal numbers as plain text, calculated exactly: 0.1 + 0.2 is 0.3. The server judges steps in the same way, in
// app/panel/numbers.py.
const NEAR = 1_000_000_000n; // within a billionth of a step

// The numbers as integers of one scale, which has this exponent.
/** @param {string[]} plains @returns {[bigint[], number]} */
export function scaled(...plains) {
  const parts = plains.map((plain) => {
    const [digits, exponent = "0"] = plain.split("e");
    const [whole, fraction = ""] = digits.split(".");
    return { digits: BigInt(whole + fraction), exponent: Number(exponent) - fraction.length };
  });
  const least = Math.min(...parts.map(({ exponent }) => exponent));
  return [parts.map(({ digits, exponent }) => digits * 10n ** BigInt(exponent - least)), least];
}

/** @param {string} one @param {string} other */
export function isLess(one, other) {
  const [[first, second]] = scaled(one, other);
  return first < second;
}

// A number is on a step if it is a whole number of steps from the lowest value, within a billionth of a step; a whole
// number, if it is exactly.
/** @param {string} plain @param {string} low @param {string} step @param {boolean} isWhole */
export function isOnStep(plain, low, step, isWhole) {
  const [[value, from, size]] = scaled(plain, low, step);
  const rest = modulo(value - from, size);
  return isWhole ? rest === 0n : least(rest, size - rest) * NEAR <= size;
}

// The step that is `times` steps from a number; between two steps, the next one counts as the first.
/** @param {string} plain @param {number} times @param {string} low @param {string} step @param {boolean} isWhole */
export function stepped(plain, times, low, step, isWhole) {
  const [[value, from, size], exponent] = scaled(plain, low, step);
  const rest = modulo(value - from, size);
  let below = value - rest;
  if (!isOnStep(plain, low, step, isWhole)) below += times < 0 ? size : 0n;
  else if (rest * 2n > size) below += size;
  return written(below + BigInt(times) * size, exponent);
}

/** @param {bigint} digits @param {number} exponent */
function written(digits, exponent) {
  if (exponent >= 0) return String(digits * 10n ** BigInt(exponent));
  const sign = digits < 0n ? "-" : "";
  const text = String(digits < 0n ? -digits : digits).padStart(1 - exponent, "0");
  return `${sign}${text.slice(0, exponent)}.${text.slice(exponent)}`.replace(/\.?0+$/, "");
}

/** @param {bigint} value @param {bigint} size */
function modulo(value, size) {
  return ((value % size) + size) % size;
}

/** @param {bigint} left @param {bigint} right */
function least(left, right) {
  // biome-ignore lint/complexity/useMathMinMax: Math.min takes no integers of any size
  return left < right ? left : right;
}

// Numbers as text in the notation of the page's language, which the server chose: what the browser's language is does
// not count. Plain text has a hyphen and a point, as the server and JSON write numbers.
//
// A typed text is a number only if it is what the panel writes for that number, up to thousands separators, trailing
// zeros, a plus sign and the width of its characters. A lone group of three digits, "1.000", is one number with a
// decimal point and another with a decimal comma: where an input permits both, it is refused too.
// app/system/texts/locales.py has the same rules.

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
// Three digits behind one sign, which may be decimals or thousands.
const LONE = /^[-+−]?[1-9]\d{0,2}[.,]\d{3}$/;
const CLOSE = /^-?[1-9]\d{0,2}\.\d{3}$/;
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

// A number as an entry shows it: it can't be taken for thousands.
/** @param {string} plain */
export function clearText(plain) {
  return numberText(CLOSE.test(plain) ? `${plain}0` : plain);
}

// The numbers that a lone group of three digits is with a decimal sign and with one of thousands, as plain texts; null
// for any other text.
/** @param {string} text @returns {string[] | null} */
export function loneGroup(text) {
  const narrow = Array.from(text.replace(AROUND, ""), (sign) =>
    /[０-９．，＋－]/.test(sign) ? String.fromCharCode(sign.charCodeAt(0) - 0xfee0) : sign,
  ).join("");
  if (!LONE.test(narrow)) return null;
  const plain = narrow.replace(MINUS, "-").replace("+", "");
  return [String(Number(plain.replace(",", "."))), plain.replace(/[.,]/, "")];
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
/** @param {string} text @param {(element: string) => number | string | null} read */
export function readNumbers(text, read) {
  return elementsOf(text)?.map((element) => read(element) ?? element) ?? [text];
}

/** @param {string[]} plains */
export function listText(plains) {
  return plains.map(clearText).join(`${SEPARATOR} `);
}
