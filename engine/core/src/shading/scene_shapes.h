// The scene as the stages read it. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>
#include <cstdint>

#include "glint.h"
#include "program/program.h"
#include "shading/closure/rows.h"

namespace glint {

constexpr size_t kPad = 8;
constexpr uint32_t kNoMaterial =
    0xffffffffu;  // of a point that the stages leave to others: no mesh

/// A group of instances, as the stages read it.
struct GroupShape {
  const float* vertices;
  const uint32_t* triangles;    // null: no mesh
  const float* normals;         // null: flat
  const uint32_t* normal_rows;  // three a triangle
  const uint16_t* slots;        // null: all primitives have `material`
  const uint32_t* materials;    // of the slots
  uint32_t material_count, material;
};

/// An instance: columns of anchored_from_object, columns of the matrix that takes normals, and
/// whether the first one mirrors.
struct InstanceShape {
  double m[12], normal[9];
  uint32_t group, mirrors;
};

/// What a material adds without any light, and its lobes that lights need, all for T = 1. Materials
/// that vary over the surface or send rays on have zeros here: `others` says so.
struct MaterialTerms {
  uint32_t view_count;  // its rows of ViewTerm
  double glow[3];       // the sum of the next three
  double ambient[3], emission[3], environment[3];
  double diffuse[3];
  uint32_t others, unlit;  // unlit: lights add nothing
};

/// Of OREN_NAYAR lobes: what A leaves of 1, over B.
constexpr double kNeverLost = 0.5 - 2 / (3 * 3.14159265358979323846);

/// A lobe that sends rays on: columns of k (three) and, where some lobe of the scene has them from
/// a program, the exponent and the index of refraction, or a normal of their own, 0 for the
/// point's.
struct PassingTerm {
  static constexpr int kPlain = 3, kExponent = 3, kIor = 4, kShaped = 5, kNormal = 5, kTurned = 8;
};

/// What of a surface is times (1 - n.v)^exponent.
struct ViewTerm {
  static constexpr size_t kDiffuse = 0, kAmbient = 3, kExponent = 6, kColumns = 7;
};

/// One term of a surface: k is final where it is constant.
struct LobeShape : GlintLobe {
  bool constant, like_last;  // like_last: its inputs are those of the lobe before
  double k[3];
};
constexpr double kSrgbToe = 0.04045;  // up to here the sRGB curve is a line
constexpr size_t kCurveSteps = 4096;  // of its table
struct TextureShape {
  const void* pixels;
  const double *decode, *linear;  // of the codes of bytes: colours, alpha
  const double* curve;            // of colours after filtering (srgb_curve); null for none
  uint32_t width, height;
  int type, extension, interpolation;
};

/// An instance as the accelerator numbers them: row of world_from_object and entry of the
/// instances' table.
struct Placement {
  uint32_t row, group;
};

/// What programs read of placements: `rows` rows of 4 numbers for each of `count` names.
struct InstanceValues {
  const Placement* placements;
  const int32_t* names;
  const float* numbers;
  size_t count, rows;

  /// The rows of a name; null where there are none.
  const float* of(int32_t name) const {
    for (size_t i = 0; i < count; ++i)
      if (names[i] == name) return numbers + 4 * rows * i;
    return nullptr;
  }
};

/// What inputs that vary over a surface are read from.
struct InputTables {
  const ProgramView* view;
  const InstanceValues* values;
  const InstanceShape* instances;
  const GlintInstances* groups;
  const GlintGeometry* geometries;
  const GlintAttribute* attributes;
  const GlintInput* inputs;
  const uint32_t*
      reads;  // for each input the number of what it reads of an image: the same for the same
  const TextureShape* textures;
};

}  // namespace glint
