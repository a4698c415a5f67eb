// Keys: "/" goes to the filter or the statement, Ctrl+Enter answers. Pages work without.
"use strict";

document.addEventListener("keydown", (event) => {
  const field = document.querySelector("[data-search]");
  const typing = event.target.closest("input, textarea, select");
  if (event.key === "/" && field && !typing) {
    event.preventDefault();
    field.focus();
  }
  if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && event.target.form) {
    event.target.form.requestSubmit();
  }
});
