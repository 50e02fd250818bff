"""What PCAO18 printed: tables II to VI, remaining landmarks in %."""

TABLE2 = {
    ("A, first controller", "Real Map 1"): 99.0,
    ("A, first controller", "Artificial Map 1"): 78.0,
    ("B, best of random search", "Real Map 1"): 71.0,
    ("B, best of random search", "Artificial Map 1"): 68.0,
    ("C, best of algorithm 1", "Real Map 1"): 13.0,
    ("C, best of algorithm 1", "Artificial Map 1"): 29.0,
}

MEANS = {
    "Real Map 1": {"pcao": 13.63, "SE(0)": 86.85, "SE(5)": 23.2, "SE(50)": 3.89, "SE(500)": 1.81},
    "Artificial Map 1": {"pcao": 29.54, "SE(0)": 91.58, "SE(5)": 40.67, "SE(50)": 13.4, "SE(500)": 11.16},
    "Real Map 2": {"pcao": 19.84, "SE(0)": 77.3, "SE(5)": 13.23, "SPSA": 33.96, "FDSA": 39.54},
    "Real Map 3": {"pcao": 34.6, "SE(0)": 77.4, "SE(5)": 15.07, "SPSA": 48.59, "FDSA": 62.75},
    "Artificial Map 2": {"pcao": 27.25, "SE(0)": 80.16, "SE(5)": 20.4, "SPSA": 52.59, "FDSA": 54.14},
}

BEST = {
    "Real Map 2": {"pcao": 13.27, "SE(0)": 67.9, "SE(5)": 5.0, "SPSA": 22.72, "FDSA": 2.36},
    "Real Map 3": {"pcao": 20.18, "SE(0)": 70.18, "SE(5)": 10.54, "SPSA": 28.36, "FDSA": 41.54},
    "Artificial Map 2": {"pcao": 23.18, "SE(0)": 72.0, "SE(5)": 10.54, "SPSA": 40.9, "FDSA": 11.72},
}
"""FDSA's best on Real Map 2 and Artificial Map 2 are as printed, far below what its means suggest."""

TABLES = {"Real Map 2": "IV", "Real Map 3": "V", "Artificial Map 2": "VI"}
