// The modes of the body, animated on request.

const place = document.getElementById("bodies");
const button = document.getElementById("move");
const CYCLE = 2000, AMPLITUDE = 0.16;
const AZIMUTH = (-62 * Math.PI) / 180, ELEVATION = (24 * Math.PI) / 180;
const calm = matchMedia("(prefers-reduced-motion: reduce)");

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A point as seen from the right and above. */
function project([x, y, z]) {
  const away = Math.cos(AZIMUTH) * x + Math.sin(AZIMUTH) * y;
  return [-Math.sin(AZIMUTH) * x + Math.cos(AZIMUTH) * y, -Math.sin(ELEVATION) * away + Math.cos(ELEVATION) * z];
}

/** A function of a phase that draws one mode. */
function picture(canvas, corners, mode) {
  const size = Math.max(...[0, 1].map((k) => Math.max(...corners.map((c) => c[k])) - Math.min(...corners.map((c) => c[k]))));
  const largest = Math.max(...mode.real.map((real, k) => Math.hypot(real, mode.imag[k]))) || 1;
  const reach = (AMPLITUDE * size) / largest;
  // Phase at which the corner that moves most peaks.
  const most = mode.real.reduce((best, real, k) => (Math.hypot(real, mode.imag[k]) > Math.hypot(mode.real[best], mode.imag[best]) ? k : best), 0);
  const offset = Math.atan2(mode.imag[most], mode.real[most]);
  const rest = corners.map(project);
  const low = [0, 1].map((k) => Math.min(...rest.map((p) => p[k]))), high = [0, 1].map((k) => Math.max(...rest.map((p) => p[k])));
  const room = 1.3 * AMPLITUDE * size;
  return (phase) => {
    const unit = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * unit), height = Math.round(canvas.clientHeight * unit);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d");
    const scale = Math.min(width / (high[0] - low[0] + 0.5 * room), height / (high[1] - low[1] + 2 * room));
    const flat = ([right, up]) => [width / 2 + scale * (right - (low[0] + high[0]) / 2), height / 2 - scale * (up - (low[1] + high[1]) / 2)];
    const moved = corners.map(([x, y, z], k) => {
      const by = reach * (mode.real[k] * Math.cos(phase - offset) - mode.imag[k] * Math.sin(phase - offset));
      return flat(project([x, y, z + by]));
    });
    const still = rest.map(flat);
    const outline = (points) => { pen.beginPath(); points.forEach((point, k) => (k ? pen.lineTo(...point) : pen.moveTo(...point))); pen.closePath(); };
    pen.clearRect(0, 0, width, height);
    pen.lineWidth = unit; pen.strokeStyle = colour("--soft"); pen.setLineDash([4 * unit, 4 * unit]);
    outline(still); pen.stroke();
    still.forEach((point, k) => { pen.beginPath(); pen.moveTo(...point); pen.lineTo(...moved[k]); pen.stroke(); });
    pen.setLineDash([]);
    outline(moved);
    pen.globalAlpha = 0.25; pen.fillStyle = colour("--accent"); pen.fill(); pen.globalAlpha = 1;
    pen.lineWidth = 2 * unit; pen.strokeStyle = colour("--accent"); pen.stroke();
    const front = [0, 1].map((k) => (still[0][k] + still[1][k]) / 2);
    pen.fillStyle = colour("--soft"); pen.font = `${12 * unit}px system-ui, sans-serif`; pen.textAlign = "left"; pen.textBaseline = "top";
    const label = ["front", Math.min(front[0] + 8 * unit, width - 34 * unit), front[1] + 8 * unit];
    pen.lineWidth = 4 * unit; pen.strokeStyle = colour("--paper"); pen.strokeText(...label);
    pen.fillText(...label);
  };
}

async function start() {
  const answer = await fetch(place.dataset.url);
  if (!answer.ok) return;
  const body = await answer.json();
  if (body.note) {
    document.getElementById("moving").hidden = false;
    document.getElementById("moving").textContent = `Not drawn: ${body.note}.`;
    return;
  }
  document.getElementById("moving").hidden = false;
  const pictures = [];
  for (const mode of body.modes) {
    const canvas = place.querySelector(`canvas[data-label="${mode.label}"]`);
    if (!canvas) continue;
    canvas.hidden = false;
    pictures.push(picture(canvas, body.corners, mode));
  }
  const draw = (phase) => pictures.forEach((each) => each(phase));
  let began = null;
  function step(now) {
    if (button.getAttribute("aria-pressed") !== "true") { began = null; draw(0); return; }
    began ??= now;
    draw((2 * Math.PI * (now - began)) / CYCLE);
    requestAnimationFrame(step);
  }
  function offer() {
    button.hidden = calm.matches;
    document.getElementById("still").hidden = !calm.matches;
    if (calm.matches) button.setAttribute("aria-pressed", "false");
  }
  button.addEventListener("click", () => {
    const isMoving = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(isMoving));
    button.textContent = isMoving ? "Stop" : "Animate";
    if (isMoving) requestAnimationFrame(step);
  });
  offer();
  calm.addEventListener("change", offer);
  new ResizeObserver(() => { if (button.getAttribute("aria-pressed") !== "true") draw(0); }).observe(place);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw(0));
  draw(0);
}

if (place) start();
