"""The page of the interface lists every route with the role on which it insists."""

from tests.online.site.test_access import ROUTES

from sprung.online.site.pages.interface import routes_of


def test_every_route_is_listed_once_with_its_role(serve) -> None:
    _, client = serve()
    document = client.get("/api/v1/openapi.json").json()
    listed = list(routes_of(document))
    expected = {
        (method, path): str(roles[0]) if roles else ""
        for method, path, roles in ROUTES
        if path.startswith("/api/v1/") or path in {"/health", "/metrics"}
    }
    assert {(method, path): role for _, method, path, _, role in listed} == expected
    text = client.get("/api").text
    assert text.count('<tr class="route">') == len(expected)
    assert all(meaning for _, _, _, meaning, _ in listed)
    assert "/api/v1/openapi.json" in text
