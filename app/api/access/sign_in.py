"""Who asks, and signing in and out from a browser."""

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, Field

from app.api.access.auth import Reader
from app.api.accounts.rates import bearer_of
from app.api.accounts.roles import Role
from app.api.accounts.sessions import give_cookie, session_of, take_cookie
from app.api.accounts.tokens import LOCAL_OPERATOR, Principal
from app.api.http.problems import problems
from app.api.schemas import API
from app.api.state import State

router = APIRouter(prefix=f"{API}/session", tags=["session"])


class SessionView(BaseModel):
    """Who asks, and what he may do."""

    name: str = Field(description="Name of the access token, or `local operator`")
    role: Role
    vehicle: str | None = Field(default=None, description="The one vehicle that a token of role vehicle acts for")
    local: bool = Field(description="True while no token was made and the user asks who runs the service")
    signed_in: bool = Field(description="True when a browser's session says who asks: it can be signed out")


@router.get(
    "",
    operation_id="getSession",
    summary="See who you are",
    responses=problems("unauthenticated", "forbidden"),
)
async def get_session(request: Request, reader: Reader) -> SessionView:
    """Return who asks and in which role, by token, by session or as the service's own user."""
    return _view(reader, signed_in=bearer_of(request.scope) is None and session_of(request.scope) is not None)


@router.post(
    "",
    operation_id="signIn",
    summary="Sign a browser in",
    status_code=201,
    responses=problems("unauthenticated", "forbidden"),
)
async def sign_in(request: Request, response: Response, state: State, reader: Reader) -> SessionView:
    """Exchange the access token in the header for a cookie that no script can read.

    The session ends with the token, by `DELETE`, or after 30 days. Without a token in the header nothing is given.
    """
    token = bearer_of(request.scope)
    if token is not None:
        give_cookie(response, request, await state.sessions.begin(token))
    return _view(reader, signed_in=token is not None)


@router.delete(
    "",
    operation_id="signOut",
    summary="Sign a browser out",
    status_code=204,
    responses=problems("unauthenticated", "forbidden"),
)
async def sign_out(request: Request, response: Response, state: State, reader: Reader) -> None:
    """End the browser's session; its live views end within seconds. The token stays valid."""
    secret = session_of(request.scope)
    if secret is not None:
        await state.sessions.end(secret)
        take_cookie(response, request)


def _view(principal: Principal, *, signed_in: bool) -> SessionView:
    local = principal is LOCAL_OPERATOR
    return SessionView(
        name=principal.name,
        role=principal.role,
        vehicle=principal.vehicle,
        local=local,
        signed_in=signed_in and not local,
    )
