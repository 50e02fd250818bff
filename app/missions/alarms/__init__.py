"""Alarms that leave the page: who is told, by which way, until somebody acknowledges.

``raised`` makes them, ``routes`` says who is told and when, ``outbox`` has the transactions, ``message`` what is told,
``channels`` how it travels, and ``dispatcher`` keeps it all going. An alarm is stored in the transaction of its line
in the mission's log; what is told of it is stored before it is sent, under an id that follows from alarm, recipient,
notice. So a restart loses nothing, and whoever gets something twice sees the same id.
"""
