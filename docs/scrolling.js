// Wide tables scroll in a box of their own, also by keyboard: then the box can have the focus, and has a name.

function nameScrollingTables() {
  for (const box of document.querySelectorAll(".md-typeset__scrollwrap")) {
    const isWide = box.scrollWidth > box.clientWidth;
    if (isWide) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
    box.role = isWide ? "group" : null;
    box.ariaLabel = isWide ? "Table, which scrolls sideways" : null;
  }
}

addEventListener("load", nameScrollingTables);
addEventListener("resize", nameScrollingTables);
