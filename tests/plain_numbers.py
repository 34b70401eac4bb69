"""Random words as plain numbers. Nothing here shares code with the package."""


def philox(counter, key):
    """Philox4x32-10 of Salmon et al. (2011), of four words and a key of two."""
    mask = 2**32 - 1
    (a, b, c, d), (k, m) = counter, key
    for _ in range(10):
        first, second = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (second >> 32) ^ b ^ k, second & mask, (first >> 32) ^ d ^ m, first & mask
        k, m = (k + 0x9E3779B9) & mask, (m + 0xBB67AE85) & mask
    return [a, b, c, d]
