"""Codes that WebSockets are closed with: those of RFC 6455, and of this service HTTP's status after a 4."""

GOING_AWAY = 1001
TRY_AGAIN = 1013
UNAUTHENTICATED = 4401
FORBIDDEN = 4403
NOT_FOUND = 4404
TOO_MANY = 4429
