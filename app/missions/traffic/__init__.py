"""Ships about, by AIS: ``watch.Traffic`` hears them and knows which are near, ``approach`` reckons how close they come."""
