/** What comes with the page and is fetched from the service when it is first wanted. */

/** Returns what asks for it: once, and again after a failure, which is forgotten. */
export function fetchedOnce<T>(address: string, read: (answer: Response) => Promise<T>): () => Promise<T> {
  let asked: Promise<T> | null = null;
  const fetched = async (): Promise<T> => {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
    return read(answer);
  };
  return () => {
    asked ??= fetched().catch((error: unknown) => {
      asked = null;
      throw error;
    });
    return asked;
  };
}
