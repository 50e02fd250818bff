/** Sends a file and tells how much of it has gone, which `fetch` does not. */

import { say } from "../words/say";
import { ServiceError, toServiceError } from "./client";

/** The answer to a file as it is; throws what the service refused, or that it does not answer. */
export function upload<T>(
  method: "POST" | "PUT",
  address: string,
  file: Blob,
  onBytes: (sent: number) => void,
  gone: AbortSignal,
): Promise<T> {
  return new Promise((answer, refuse) => {
    const request = new XMLHttpRequest();
    const stop = () => request.abort();
    request.open(method, address);
    request.setRequestHeader("Accept", "application/json");
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.onprogress = ({ loaded }) => onBytes(loaded);
    request.onload = () => {
      const { status, statusText, responseText } = request;
      if (status >= 200 && status < 300) answer(JSON.parse(responseText) as T);
      else void toServiceError(new Response(responseText, { status, statusText })).then(refuse);
    };
    request.onerror = () =>
      refuse(
        new ServiceError(say("service.theServiceDoesNotAnswer"), 0, say("service.checkThatItIsRunningAnd")),
      );
    request.onabort = () => refuse(new DOMException("aborted", "AbortError"));
    request.onloadend = () => gone.removeEventListener("abort", stop);
    if (gone.aborted) {
      refuse(new DOMException("aborted", "AbortError"));
      return;
    }
    gone.addEventListener("abort", stop);
    request.send(file);
  });
}
