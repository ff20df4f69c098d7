"use strict";
// What is folded on the screen is open on paper, but for the small print of tables.
addEventListener("beforeprint", () => {
  for (const d of document.querySelectorAll("details:not([open]):not(td details)")) { d.dataset.folded = ""; d.open = true; }
});
addEventListener("afterprint", () => {
  for (const d of document.querySelectorAll("details[data-folded]")) { delete d.dataset.folded; d.open = false; }
});
