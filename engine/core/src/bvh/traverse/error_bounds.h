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

/// Where wrong weights put a depth, as part of the corners' coordinates. Sheared corners are off by
/// u (4 z + 2 x), edge functions by 6 x times that, weighted depths by 72 times that: 288 u is less
/// than 2^-15.
constexpr float kWeightMargin = 0x1p-15f;
/// What the sum of weighted depths rounds, as part of the largest: 16 u.
constexpr float kSumMargin = 0x1p-20f;

/// What edge functions of an apex packet and those of its rays differ by, as part of m (s z + m):
/// 64 u (edge_lines derives 20).
constexpr float kEdgeMargin = 0x1p-18f;

}  // namespace
}  // namespace glint
