"""Routes are found by their paths' parts as the framework finds them one after the other."""

from fastapi import APIRouter
from fastapi.routing import APIRoute
from hypothesis import given
from hypothesis import strategies as st

from app.api.http.route_index import RouteIndex

router = APIRouter()


async def _nothing() -> None:
    pass


for _path, _methods in (
    ("/a", ["GET"]),
    ("/a/{x}", ["GET", "PUT"]),
    ("/a/b", ["GET"]),
    ("/{x}/b", ["GET", "DELETE"]),
    ("/a/{x}.json", ["GET"]),
    ("/a/{x}/c", ["GET"]),
    ("/a/b/{y}", ["GET", "POST"]),
    ("/files/{rest:path}", ["GET"]),
    ("/files/a/{x}", ["GET"]),
    ("/", ["GET"]),
):
    router.add_api_route(_path, _nothing, methods=_methods)

ROUTES = [route for route in router.routes if isinstance(route, APIRoute)]
PARTS = st.sampled_from(["a", "b", "c", "files", "x.json", ".json", "", "{x}", "a\n", "%2F"])


@given(st.sampled_from(["GET", "PUT", "POST", "DELETE", "HEAD"]), st.lists(PARTS, max_size=4))
def test_the_first_route_that_matches_is_found(method: str, parts: list[str]) -> None:
    path = "/" + "/".join(parts)
    expected = next((r for r in ROUTES if method in (r.methods or ()) and r.path_regex.match(path)), None)
    found = RouteIndex((route, number) for number, route in enumerate(ROUTES)).find(method, path)
    # A line break at a path's end matches nothing that anyone meant: such a path may go unfound.
    if found is None:
        assert expected is None or path.endswith("\n")
        return
    match = found[0].path_regex.match(path)
    assert match is not None
    assert found[1] == match.groupdict()
    assert found[2] == ROUTES.index(found[0])
    assert found[0] is expected or path.endswith("\n")


def test_what_belongs_to_a_method_is_listed_in_order() -> None:
    index = RouteIndex((route, route.path) for route in ROUTES)
    assert index.of("DELETE") == ["/{x}/b"]
    assert index.of("PUT") == ["/a/{x}"]
