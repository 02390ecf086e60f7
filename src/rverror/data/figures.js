// Draws each figure whose data stand beside its still picture, at the size of that.
for (const told of document.querySelectorAll("figure script")) {
  const box = told.parentNode, still = box.querySelector("svg"), figure = JSON.parse(told.textContent);
  box.id = figure.id;
  try {
    mpld3.draw_figure(figure.id, figure);
  } catch (error) {
    console.error(error);
    continue;
  }
  const drawn = box.querySelector(".mpld3-figure");
  drawn.setAttribute("viewBox", `0 0 ${figure.width} ${figure.height}`);
  for (const side of ["width", "height"]) drawn.setAttribute(side, still.getAttribute(side));
  still.remove();
}
