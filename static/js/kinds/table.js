// Shows the rows of a table. Rows and cells stay in place: only what has changed is written.
import { setText } from "../show.js";

/** @type {Record<string, Show>} */
export const show = {
  table_rows: (root, rows) => {
    for (const [number, row] of root.querySelectorAll("tbody tr").entries()) showRow(row, rows[number]);
  },
};

/** @param {HTMLTableRowElement} row @param {{ age?: string, cells: CellValue[] } | undefined} values */
function showRow(row, values) {
  row.toggleAttribute("data-empty", !values);
  row.toggleAttribute("data-old", Boolean(values?.age));
  setText(row.querySelector(".age"), values?.age ?? "");
  for (const [number, cell] of [...row.cells].entries()) showCell(cell, values?.cells[number]);
}

/** @param {HTMLElement} cell @param {CellValue | undefined} value */
function showCell(cell, value) {
  setText(cell.querySelector(".cell-text"), value?.text ?? "");
  if (cell.dataset.shape === undefined) return;
  cell.dataset.shape = value?.shape ?? "";
  cell.dataset.colour = value?.colour ?? "";
}
