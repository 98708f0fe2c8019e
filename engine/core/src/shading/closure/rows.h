// Where the lobes of points stand that lights need, as rows of numbers: by kind, each as wide as
// its kind. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>

#include "shading/closure/table.h"

namespace glint {

/// The least width alpha of a lobe of GGX, Beckmann or Ashikhmin and Shirley: one over its square,
/// squared, is finite.
constexpr double kLeastWidth = 0x1p-20;

/// Columns of SPECULAR lobes, and of MIRROR ones as highlights (EvaluateStage::thrown): k (three)
/// and the exponent, of GGX and Beckmann that of a power as wide; where some lobe of the scene is
/// shaped, the square of its masking, what `fresnel` says and its GlintDistribution; where some may
/// have a normal of its own that, 0 for the point's; where some may be stretched a direction across
/// it, as long as slopes of half vectors along it are times, and those across both over that, 0 for
/// none.
struct MicrofacetRow {
  static constexpr int kExponent = 3, kPlain = 4, kMasking = 4, kFresnel = 5, kDistribution = 6,
                       kShaped = 7, kNormal = 7, kTurned = 10, kStretch = 10, kStretched = 13;
  /// 0 for none, -1 for Schlick's weight, kEdge for that of edges, or a dielectric's index.
  static constexpr double kEdge = -2, kGgx = GLINT_GGX, kBeckmann = GLINT_BECKMANN,
                          kAshikhminShirley = GLINT_ASHIKHMIN_SHIRLEY;
  static double fresnel(int bits, double ior) {
    return bits & GLINT_EDGE         ? kEdge
           : bits & GLINT_SCHLICK    ? -1
           : bits & GLINT_DIELECTRIC ? ior
                                     : 0;
  }
};

struct SheenRow {
  static constexpr int kWidth = 3, kLean = 4;
};

struct ToonRow {
  static constexpr int kSize = 3, kSmooth = 4;
};

/// tangent: as long as the fibre is thick, all that FIBRE_DIFFUSE lobes have. fan: one over the
/// lobe's, 0 for none.
struct FibreRow {
  static constexpr int kTangent = 3, kExponent = 6, kFan = 7, kTilt = 8;
};

/// A row: its first column, and how many there are.
struct LobeSpan {
  size_t first, width;
};

/// The rows of a kind: the first column, how many columns each has, and how many there are.
struct LobeRows {
  int first = 0, width = 0, count = 0;
};

/// Of a scene, by GlintLobeKind. MIRROR's rows follow SPECULAR's and are as wide; a point's
/// OREN_NAYAR lobes of a kind are in one, as they are seen.
struct LobeLayout {
  LobeRows of[kLobeKinds];
  int columns = 0;

  /// The first column of a row.
  int row(int kind, int number) const { return of[kind].first + of[kind].width * number; }
};

}  // namespace glint
