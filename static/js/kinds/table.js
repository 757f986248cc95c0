// Shows the rows of a table. Rows and cells stay in place: only what has changed is written.
import { setText } from "../show.js";

export const show = {
  table_rows: (root, rows) => {
    root.querySelectorAll("tbody tr").forEach((row, number) => showRow(row, rows[number]));
  },
};

function showRow(row, values) {
  row.toggleAttribute("data-empty", !values);
  row.toggleAttribute("data-old", Boolean(values?.age));
  setText(row.querySelector(".age"), values?.age ?? "");
  [...row.cells].forEach((cell, number) => showCell(cell, values?.cells[number]));
}

function showCell(cell, value) {
  setText(cell.querySelector(".cell-text"), value?.text ?? "");
  if (cell.dataset.shape === undefined) return;
  cell.dataset.shape = value?.shape ?? "";
  cell.dataset.colour = value?.colour ?? "";
}
