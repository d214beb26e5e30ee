// The motion between its samples: cubic Hermite polynomials in positions, lines in everything else.

// Index k of the sample at or before t, and the fraction of the way to the next one.
export function place(time, t) {
  let low = 0;
  let high = time.length - 1;
  if (t >= time[high]) return [high - 1, 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle;
  }
  return [low, Math.max(0, (t - time[low]) / (time[low + 1] - time[low]))];
}

export function positions({ time, q, dq }, t) {
  const [k, u] = place(time, t);
  const h = time[k + 1] - time[k];
  const a = (1 + 2 * u) * (1 - u) ** 2;
  const b = u * (1 - u) ** 2 * h;
  const c = u * u * (3 - 2 * u);
  const d = u * u * (u - 1) * h;
  return q[k].map((_, j) => a * q[k][j] + b * dq[k][j] + c * q[k + 1][j] + d * dq[k + 1][j]);
}

// Values of rows of samples at t, straight between them; NaN where one is not known.
export function between(time, rows, t) {
  const [k, u] = place(time, t);
  const [before, after] = [rows[k], rows[k + 1]];
  return before.map((value, j) => (value === null || after[j] === null ? NaN : (1 - u) * value + u * after[j]));
}
