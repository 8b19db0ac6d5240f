"""Where in Zenoh's key space a site speaks: `wayside/v1/{site}/...`. A site's id has no slash and no wildcard (see the site file)."""


def site_key(site: str, what: str) -> str:
    """`wayside/v1/kokubunji-1/health` of a site's id and one of the words below."""
    return f"wayside/v1/{site}/{what}"


HEALTH = "health"  # SignedHealth, put after every epoch; the latest of them by query too
CHALLENGE = "challenge"  # query with a nonce of 16 bytes, answered by a SignedChallengeReply
EPOCH = "epoch"  # EpochReport
ALERT = "alert"  # Alert, with a cache for those who come late
ALIVE = "alive"  # liveliness token
INFO = "info"  # query, answered by a SiteInfo


def train_key(train: str) -> str:
    """Where a train says where it is: TrainPosition."""
    return f"wayside/v1/trains/{train}/position"
