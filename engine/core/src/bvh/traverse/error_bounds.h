// Bounds of what rounding does to traversal, each with where it comes from. u = 2^-24 is the unit
// of rounding of float, U = 2^-53 that of double: a result is off by at most so much of itself.
#pragma once

namespace glint {
namespace {

// --- Double

/// Hits that are farther apart than this part of their distance are not at one distance, whatever
/// rounding has done to them. key_of drops 12 of 52 bits, so that distances up to 2^-40 apart may
/// agree; a sixteenth of that, 512 U, is for the rounding of either.
constexpr double kTie = 0x1.1p-40;

/// What a point on a ray is off by, as part of the distance to the ray's origin: 128 U, for the
/// difference to the tree's plane, the slope, their product and sum, and an instance's matrix.
constexpr double kFarRounding = 0x1p-46;
/// Tile::far_margin times this: kTie of the distance of rays from far away.
constexpr float kFarTie = float(kTie / kFarRounding);

// --- From double to float

/// What the ends of a ray's depth interval are moved by, as part of the depth: 4 u. Narrowing to
/// float takes one, adding where the ray starts another.
constexpr double kDepthMargin = 0x1p-22;

// --- Float

/// Float tests multiply three coordinates: so much each, or rays that begin farther across, which
/// miss all that is nearer. Products stay below 1e36, and 72 of them (kWeightMargin) below the
/// largest float.
constexpr double kWide = 1e12;

/// What products of edge functions and depths lose below the smallest normal float: half of 2^-149
/// for each of less than 2^6 products, times a depth below kWide < 2^40.
constexpr float kUnderflow = 0x1p-104f;

/// What coordinates of rays and boxes are off by on the way to a test, as part of the largest: 20
/// u.
constexpr double kBoxMargin = 0x1.4p-20;
/// That many times the rounding of double where rays go through instances, whose matrices may be
/// hard to invert.
constexpr double kInstanceMargin = 0x1p12;

/// What a corner seen in float is off by, as part of its depth and of its place across: 6.5 u and
/// 3.5 u, and u more for the products of edge functions. Its difference to the origin is off by 2
/// u, which are 2 u (x + z) in the ray's order; the slope by u, its product with the depth by 2 u
/// more of that and u of its own, the sum by u.
constexpr float kSeenAlong = 0x1.ap-22f, kSeenAcross = 0x1.2p-22f;
/// More than two products lose below the smallest normal float, 2^-140: itself normal, as sums with
/// a subnormal one take some processors far longer.
constexpr float kLeastProduct = 0x1p-126f;
/// What the sum of weighted depths rounds, as part of the largest: 16 u.
constexpr float kSumMargin = 0x1p-20f;

}  // namespace
}  // namespace glint
