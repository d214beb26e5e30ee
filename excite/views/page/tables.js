// Sorts a table by the column whose heading is pressed: numbers by their exact values, texts by their letters.
"use strict";

const key = (row, column) => {
  const cell = row.cells[column];
  return cell.dataset.value === undefined ? cell.textContent.trim() : Number(cell.dataset.value);
};

const order = (a, b) => {
  if (typeof a === "number" && typeof b === "number") return a - b;
  if (typeof a !== typeof b) return typeof a === "number" ? -1 : 1; // what is not known comes last
  return a.localeCompare(b, "en", { numeric: true });
};

document.querySelectorAll("table.sortable").forEach((table) => {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.firstElementChild.addEventListener("click", () => {
      const down = heading.getAttribute("aria-sort") === "ascending";
      const rows = [...table.tBodies[0].rows];
      rows.sort((a, b) => (down ? -1 : 1) * order(key(a, column), key(b, column)));
      table.tBodies[0].append(...rows);
      headings.forEach((each) => each.setAttribute("aria-sort", "none"));
      heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    });
  });
});

// Paper is white: what is printed has the light colours, and what belongs on paper is unfolded.
window.addEventListener("beforeprint", () => {
  document.documentElement.classList.add("printed");
  document.querySelectorAll("details[data-print]:not([open])").forEach((each) => {
    each.open = true;
    each.dataset.print = "closed";
  });
});
window.addEventListener("afterprint", () => {
  document.documentElement.classList.remove("printed");
  document.querySelectorAll('details[data-print="closed"]').forEach((each) => {
    each.open = false;
    each.dataset.print = "";
  });
});
