// Names of new things.

/** The name, or the first of its kind that nothing has: `material`, `material 2`, `material 3`. */
export function freshName(base: string, taken: unknown[]): string {
  for (let number = 1; ; number++) {
    const name = number === 1 ? base : `${base} ${number}`;
    if (!taken.includes(name)) return name;
  }
}
