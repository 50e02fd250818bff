"""Ships about, by AIS: ``watch.Traffic`` hears them, ``approach`` reckons how close they come to vehicles."""
