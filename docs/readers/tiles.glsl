// An endless plane of corner tiles. One unit of `at` is one tile; at.y grows downwards, as rows do.
// `tiles` is the packed picture: repeated both ways, first row first, with mipmaps.
// GLSL 1.30 or ES 3.00.
const int COLOURS = 2, SIDE = 4;
const int PLACE[16] = int[16](0, 4, 3, 5, 1, 13, 8, 6, 12, 2, 7, 11, 15, 9, 14, 10);

int corner(ivec2 at) {  // the colour of a corner, at random
    uint h = uint(at.x) * 0x8da6b343u ^ uint(at.y) * 0xd8163841u;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    h = (h ^ (h >> 15)) * 0x9e3779b1u;
    return int((h >> 16) % uint(COLOURS));
}

vec4 cornerTiles(sampler2D tiles, vec2 at) {
    vec2 cell = floor(at);
    ivec2 c = ivec2(cell);
    int upper = corner(c) * COLOURS + corner(c + ivec2(1, 0));
    int lower = corner(c + ivec2(0, 1)) * COLOURS + corner(c + ivec2(1, 1));
    int place = PLACE[upper * COLOURS * COLOURS + lower];
    vec2 there = vec2(place % SIDE, place / SIDE) + at - cell;
    float side = float(SIDE);
    return textureGrad(tiles, there / side, dFdx(at) / side, dFdy(at) / side);
}
