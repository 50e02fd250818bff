import { afterEach, describe, expect, it, vi } from "vitest";
import { fetchedOnce } from "./fetchedOnce";

afterEach(() => vi.unstubAllGlobals());

describe("what is fetched once", () => {
  it("is asked for again after a failure, and no more when it has come", async () => {
    const answers = [new Response("gone", { status: 404 }), new Response("here")];
    const asked = vi.fn(async () => answers.shift());
    vi.stubGlobal("fetch", asked);
    const wanted = fetchedOnce("/table", (answer) => answer.text());
    await expect(wanted()).rejects.toThrow("404");
    expect(await wanted()).toBe("here");
    expect(await wanted()).toBe("here");
    expect(asked).toHaveBeenCalledTimes(2);
  });
});
