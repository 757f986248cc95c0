// Decimal numbers as plain text, calculated exactly: 0.1 + 0.2 is 0.3. The server judges steps in the same way, in
// app/panel/number_range.py.
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

/** @param {bigint} one @param {bigint} other */
function least(one, other) {
  // biome-ignore lint/complexity/useMathMinMax: Math.min takes no integers of any size
  return one < other ? one : other;
}
