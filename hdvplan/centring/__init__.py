"""The geometry of centring: stationary circles and the weight K."""
