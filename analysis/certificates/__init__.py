"""Almost stable, with proof: the car, its roads and exported runs before the methods of `bertolino_baksa`."""
