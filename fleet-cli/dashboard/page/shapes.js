// Small shapes of the map's picture, in pixels.

export function circle(context, x, y, radius, colour, alpha, width = 1) {
  context.globalAlpha = alpha;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
  context.globalAlpha = 1;
}

export function disc(context, x, y, radius, colour) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

// A goal: a ring, a dot and, if it has one, its heading.
export function flag(context, [x, y], yaw_rad, colour, radius) {
  circle(context, x, y, radius, colour, 1, 2.5);
  disc(context, x, y, radius / 3, colour);
  if (yaw_rad === null || yaw_rad === undefined) return;
  const [ux, uy] = [Math.cos(yaw_rad), -Math.sin(yaw_rad)];
  context.strokeStyle = colour;
  context.lineWidth = 2.5;
  context.beginPath();
  context.moveTo(x + radius * ux, y + radius * uy);
  context.lineTo(x + (radius + 12) * ux, y + (radius + 12) * uy);
  context.stroke();
}

export function wheels(context, length, width, colour) {
  context.fillStyle = colour;
  context.globalAlpha = 0.75;
  for (const x of [-0.29, 0.29]) {
    for (const y of [-0.43, 0.43]) {
      context.fillRect((x - 0.14) * length, y * width - width * 0.07, 0.28 * length, width * 0.14);
    }
  }
  context.globalAlpha = 1;
}

export function octagon(context, x, y, radius, fill, edge) {
  context.beginPath();
  for (let i = 0; i < 8; i += 1) {
    const angle = Math.PI / 8 + (i * Math.PI) / 4;
    context.lineTo(x + radius * Math.cos(angle), y + radius * Math.sin(angle));
  }
  context.closePath();
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = edge;
  context.lineWidth = 1.5;
  context.stroke();
}
