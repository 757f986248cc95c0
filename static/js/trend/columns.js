// The columns of a trend's pen: [number, lowest, highest, last, whether it begins a line].

// The old ones, and the server's in place of those from `since` on (0: of all): it says [number, value], [number,
// lowest, highest, last], or null where a line ends. One before the plot stays: a line comes in from there.
/** @param {Column[]} old @param {ColumnItem[]} items @param {number} since @param {(number: number) => boolean} isBefore @returns {Column[]} */
export function merged(old, items, since, isBefore) {
  const columns = since ? old.filter(([number]) => number < since) : [];
  let starts = false;
  for (const item of items) {
    if (item && item[0] >= since)
      columns.push(item.length === 2 ? [item[0], item[1], item[1], item[1], starts] : [...item, starts]);
    starts = item === null;
  }
  const first = columns.findIndex(([number]) => !isBefore(number));
  if (first < 0) return columns.slice(-1);
  return first > 0 ? columns.slice(first - 1) : columns;
}
