"""The page without a mouse, and heard instead of seen: where the keyboard is after a command, what is told once."""

import pytest
from playwright.sync_api import Page, expect

from tests.support.dashboard.service import Service
from tests.support.dashboard.steps import by_id, picture

pytestmark = [pytest.mark.browser, pytest.mark.timeout(400)]

NO_WEBGL = """() => {
    const context = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind.startsWith("webgl") ? null : context.call(this, kind, ...rest);
    };
}"""


def test_that_the_map_cannot_be_drawn_is_told_where_nothing_covers_it(page: Page, service: Service) -> None:
    page.add_init_script(f"({NO_WEBGL})()")
    page.goto(f"/#/missions/{service.create(name='No map')}")
    expect(by_id(page, "map-fault")).to_contain_text("The map cannot be drawn")
    picture(page, "map-fault")
    page.wait_for_function(
        """() => {
            const fault = document.querySelector("[data-testid=map-fault]");
            const { left, right, top, bottom } = fault.getBoundingClientRect();
            return [[left + 4, top + 4], [right - 4, top + 4], [left + 4, bottom - 4], [right - 4, bottom - 4]]
                .every(([x, y]) => fault.contains(document.elementFromPoint(x, y)));
        }"""
    )
