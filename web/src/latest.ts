// Work that takes time, for a state that changes meanwhile.

/**
 * A function that starts the work, or has it repeated once if it is under way: one question at a
 * time, and the last one is about the newest state.
 */
export function latest(work: () => Promise<void>): () => void {
  let isRunning = false;
  let again = false;
  return () => {
    again = true;
    if (isRunning) return;
    isRunning = true;
    void (async () => {
      while (again) {
        again = false;
        await work().catch(reportError);
      }
      isRunning = false;
    })();
  };
}
