// The axis of a trend's values: its ends and the lines of its grid, the same as `axis_range` and `value_ticks` in
// app/view/trend_plot.py. Total: for all doubles but NaN the ends are finite and the ticks few.

const LARGEST = 1e300; // of an axis: sums and differences of such values are finite
const LEAST_WIDTH = 1e-300;
const NARROWEST = 1e-9; // relative: a narrower axis has ticks that doubles can't tell apart
const MARGIN = 0.05;
const MOST_DIGITS = 12; // after the point

/** @param {number} value */
const drawable = (value) => Math.min(Math.max(value, -LARGEST), LARGEST);

// [low, high] for values from `low` to `high`, with a margin where an end is not fixed (undefined).
/** @param {number} lowest @param {number} highest @param {number | undefined} fixedLow @param {number | undefined} fixedHigh @returns {[number, number]} */
export function axisRange(lowest, highest, fixedLow, fixedHigh) {
  let low = drawable(fixedLow ?? lowest);
  let high = drawable(fixedHigh ?? highest);
  const largest = Math.max(Math.abs(low), Math.abs(high));
  if (high - low < Math.max(largest * NARROWEST, LEAST_WIDTH)) {
    const margin = largest * MARGIN >= LEAST_WIDTH ? largest * MARGIN : 1;
    if (fixedLow !== undefined) high = low + margin;
    else if (fixedHigh !== undefined) low = high - margin;
    else [low, high] = [high - margin, high + margin];
  }
  const margin = (high - low) * MARGIN;
  return [fixedLow === undefined ? low - margin : low, fixedHigh === undefined ? high + margin : high];
}

// [value, text] of the lines of the grid, about `most`; the text has a hyphen and a point.
/** @param {number} low @param {number} high @param {number} most @returns {Generator<[number, string]>} */
export function* valueTicks(low, high, most) {
  const least = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(least));
  const factor = [1, 2, 2.5, 5].find((by) => power * by >= least * 0.999) ?? 10;
  const step = power * factor;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9) + (factor === 2.5 ? 1 : 0));
  const isFixedPoint = Math.max(Math.abs(low), Math.abs(high)) < 1e6 && digits <= MOST_DIGITS;
  const last = Math.floor(high / step + 1e-9);
  for (let count = Math.ceil(low / step - 1e-9); count <= last; count++) {
    const value = count * step;
    yield [value, isFixedPoint ? value.toFixed(digits) : Number(value.toPrecision(4)).toString()];
  }
}
