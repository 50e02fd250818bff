import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";

/**
 * Never lower than it has been at this width: its words come and go several times a second, and what lies below would
 * move away from under a pointer that is about to press.
 */
export function Steady({ children }: { children: ComponentChildren }) {
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = box.current;
    if (!element) return;
    let width_px = 0;
    const observer = new ResizeObserver(() => {
      // At another width it is as high as it needs to be.
      if (element.clientWidth !== width_px) element.style.minHeight = "";
      width_px = element.clientWidth;
      element.style.minHeight = `${element.getBoundingClientRect().height}px`;
    });
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  return (
    <div ref={box} class="steady">
      {children}
    </div>
  );
}
