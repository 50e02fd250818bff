"""What an operator describes: a mission, declared once. Schemas, forms and help are made from ``MissionSpec``."""
