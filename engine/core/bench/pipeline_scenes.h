// Scenes of a wavy grid for the benches of the pipeline: one material and its lights, and a small
// thing behind the camera that no ray meets.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "glint.h"
#include "integrator/plan.h"
#include "scene/scene.h"

namespace glint::bench {

constexpr uint32_t kWidth = 960, kHeight = 540;
constexpr Vec3d kEye{5.5, -7, 5};

/// A wavy grid of 2 side^2 triangles with normals and a UV map.
struct Grid {
  std::vector<float> vertices, normals, uv;
  std::vector<uint32_t> triangles;
  explicit Grid(uint32_t side) {
    for (uint32_t i = 0; i <= side; ++i)
      for (uint32_t j = 0; j <= side; ++j) add(-4 + 8.0 * i / side, -4 + 8.0 * j / side);
    for (uint32_t i = 0; i < side; ++i)
      for (uint32_t j = 0; j < side; ++j) {
        uint32_t a = i * (side + 1) + j, b = a + side + 1;
        for (uint32_t v : {a, b, b + 1, a, b + 1, a + 1}) triangles.push_back(v);
      }
  }
  void add(double x, double y) {
    for (double c :
         {x, y, 0.35 * std::sin(3 * x) * std::cos(2.5 * y) + 0.03 * std::sin(41 * x + 37 * y)})
      vertices.push_back(float(c));
    for (double c : {-1.05 * std::cos(3 * x) * std::cos(2.5 * y),
                     0.875 * std::sin(3 * x) * std::sin(2.5 * y), 1.0})
      normals.push_back(float(c));
    for (double c : {x / 8 + 0.5, y / 8 + 0.5}) uv.push_back(float(c));
  }
};

struct Variant {
  const char* name;
  bool smooth, textured;
  std::vector<int> lobes;
  std::vector<int> lights;
  double radius;
  uint32_t light_samples;
  std::vector<int> unseen = {};  // lobes of a triangle behind the camera
  bool unseen_textured = false, unseen_sphere = false;
  uint32_t light_flags = GLINT_CAST_SHADOW;
  enum Special { kNone, kSmooth, kStrands, kMedium, kOffsets, kLens, kMotion } special = kNone;
};

/// Columns x, y, z, t of a frame at `eye` whose z axis points away from the origin.
inline void look_at_origin(double (&m)[12], Vec3d eye) {
  Vec3d z = unit(eye), x = unit(cross({0, 0, 1}, z)), y = cross(z, x);
  for (int r = 0; r < 3; ++r) {
    m[4 * r] = x[r];
    m[4 * r + 1] = y[r];
    m[4 * r + 2] = z[r];
    m[4 * r + 3] = eye[r];
  }
}

/// Everything that a scene's description points at.
struct Description {
  GlintGeometry geometries[2]{};
  GlintAttribute uv{};
  GlintInstances instances[2]{};
  double matrices[24] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  uint32_t slots[2] = {0, 1};
  const float behind[9] = {11, -14, 10, 11.25f, -14, 10, 11, -13.75f, 10};
  const float unseen_radius = 0.25f, strand_radii[2] = {0.1f, 0.1f};
  const float normals_behind[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
  GlintMedium medium{};
  const uint32_t triangle[3] = {0, 1, 2};
  std::vector<uint8_t> pixels;
  GlintTexture texture{};
  GlintInput inputs[2]{};
  std::vector<GlintLobe> lobes;
  GlintMaterial materials[2]{};
  std::vector<GlintLight> lights;
  GlintSceneData data{};

  Description(const Grid& grid, const Variant& v) {
    place(grid, v);
    if (!v.unseen.empty()) place_behind(v);
    paint(v);
    for (int kind : v.lights) light(kind, v.radius, v.light_flags);
    GlintCamera& c = data.camera;
    look_at_origin(c.world_from_camera, kEye);
    const double window[4] = {-0.5, 0.5, -0.5 * kHeight / kWidth, 0.5 * kHeight / kWidth};
    std::copy_n(window, 4, c.window);
    c.clip_start = 0.1;
    c.clip_end = 1000;
    c.width = kWidth;
    c.height = kHeight;
    c.kind = GLINT_PERSPECTIVE;
    for (int k = 0; k < 3; ++k) {
      data.ambient[k] = 0.05;
      data.background[k] = 0.2;
    }
    point_at_tables();
  }

  void place(const Grid& grid, const Variant& v) {
    GlintGeometry& geometry = geometries[0];
    geometry.vertices = grid.vertices.data();
    geometry.vertex_count = grid.vertices.size() / 3;
    geometry.triangles = grid.triangles.data();
    geometry.primitive_count = grid.triangles.size() / 3;
    geometry.kind = GLINT_MESH;
    geometry.attribute_count = 1;
    if (v.smooth)
      geometry.normals = {grid.normals.data(), grid.normals.size() / 3, 0, GLINT_POINT, 3, 0};
    uv = {grid.uv.data(), grid.uv.size() / 2, 0, GLINT_POINT, 2, 0};
    constexpr uint32_t kSeen = GLINT_VISIBLE_CAMERA | GLINT_VISIBLE_MIRROR | GLINT_VISIBLE_SHADOW |
                               GLINT_VISIBLE_TRANSMISSION | GLINT_VISIBLE_DIFFUSE;
    instances[0] = {0, 1, 0, kSeen, 0, 1, 0, 0};
    instances[0].geometry_offset = 0.1;
    data.geometry_count = data.instances_count = data.row_count = data.material_slot_count =
        data.material_count = 1;
  }

  /// Of SHEEN and TOON lobes, both numbers.
  static double shape_of(int kind) {
    const bool toon = kind == GLINT_TOON_DIFFUSE || kind == GLINT_TOON_SPECULAR;
    return toon || kind == GLINT_SHEEN ? 0.4 : 0;
  }

  /// A second thing and its material.
  void place_behind(const Variant& v) {
    GlintGeometry& geometry = geometries[1];
    geometry.vertices = behind;
    geometry.vertex_count = v.unseen_sphere ? 1 : 3;
    geometry.primitive_count = 1;
    geometry.kind = v.unseen_sphere ? GLINT_SPHERES : GLINT_MESH;
    if (v.unseen_sphere) geometry.radii = &unseen_radius;
    else geometry.triangles = triangle;
    if (v.special == Variant::kSmooth || v.special == Variant::kOffsets)
      geometry.normals = {normals_behind, 3, 0, GLINT_POINT, 3, 0};
    if (v.special == Variant::kStrands) {
      geometry.kind = GLINT_STRANDS;
      geometry.triangles = nullptr;
      geometry.radii = strand_radii;
      geometry.indices = triangle;
      geometry.index_count = 1;
      geometry.vertex_count = 2;
    }
    instances[1] = instances[0];
    instances[1].first_row = 1;
    instances[1].geometry = 1;
    instances[1].first_material = 1;
    if (v.special == Variant::kOffsets)
      instances[1].geometry_offset = instances[1].shading_offset = 0.5;
    data.geometry_count = data.instances_count = data.row_count = data.material_slot_count =
        data.material_count = 2;
  }

  void paint(const Variant& v) {
    for (uint32_t k = 0; k < 4 * 512 * 512; ++k) pixels.push_back(uint8_t(k * 2654435761u >> 24));
    texture = {pixels.data(), 512, 512, GLINT_UINT8, GLINT_SRGB, GLINT_REPEAT, GLINT_LINEAR};
    const bool textured[2] = {v.textured, v.unseen_textured};
    for (uint32_t m = 0; m < 2; ++m) {
      GlintInput& input = inputs[m];
      input = {};
      input.value[0] = 0.5;
      input.value[1] = 0.4;
      input.value[2] = 0.3;
      input.uv_transform[0] = input.uv_transform[4] = 3;
      input.low = 0;
      input.high = 1;
      input.texture = textured[m] ? 0 : -1;
      input.channel = GLINT_COLOR;
      input.uv = 0;
      input.attribute = -1;
      input.attribute_channel = GLINT_COLOR;
      const std::vector<int>& kinds = m == 0 ? v.lobes : v.unseen;
      materials[m] = {uint32_t(lobes.size()), uint32_t(kinds.size()), 0, 0, 0, 0};
      materials[m].medium = m == 1 && v.special == Variant::kMedium;
      for (int kind : kinds)
        lobes.push_back({.exponent = kind == GLINT_SPECULAR ? 60.0 : shape_of(kind),
                         .masking = shape_of(kind),
                         .ior = kind == GLINT_TRANSPARENT ? 1.0 : 1.5,
                         .radius = {},
                         .first_input = m,
                         .input_count = 1,
                         .kind = kind,
                         .fresnel = kind == GLINT_REFRACTION || kinds[0] == GLINT_REFRACTION
                                        ? GLINT_DIELECTRIC
                                        : 0,
                         .exponent_slot = 0,
                         .masking_slot = 0,
                         .ior_slot = 0,
                         .fibre_slot = 0,
                         .normal_slot = 0,
                         .stretch_slot = 0,
                         .radius_slot = 0,
                         .distribution = GLINT_BLINN_PHONG});
    }
  }

  /// extent: the radius, the sun's angle or the sides of an area.
  void light(int kind, double extent, uint32_t flags) {
    GlintLight g{};
    look_at_origin(g.world_from_light, kind == GLINT_SUN ? Vec3d{-2, -1, 3} : Vec3d{2, -3, 5});
    for (double& c : g.color) c = 1;
    g.strength = kind == GLINT_SUN ? 3 : 900;
    g.spot_size = 1;
    g.spot_blend = 0.3;
    g.kind = kind;
    g.flags = flags;
    g.spread = 4;
    g.radius = g.angle = g.size_x = g.size_y = extent;
    lights.push_back(g);
  }

  void point_at_tables() {
    data.geometries = geometries;
    data.attributes = &uv;
    data.attribute_count = 1;
    data.instances = instances;
    data.world_from_object = matrices;
    data.material_slots = slots;
    data.textures = &texture;
    data.texture_count = 1;
    data.inputs = inputs;
    data.input_count = 2;
    data.lobes = lobes.data();
    data.lobe_count = lobes.size();
    data.materials = materials;
    data.lights = lights.data();
    data.light_count = lights.size();
    for (double& a : medium.absorption) a = 0.5;
    medium.step = 1.0 / 32;
    data.media = &medium;
    data.medium_count = 1;
  }
};

/// Two samples of a region, with points of its own.
struct Plan : RenderPlan {
  std::vector<double> points, camera;  // camera: the middle of the lens, or where it stands
  Plan(const Variant& v, Region of) : points(4 * v.light_samples + 4) {
    for (size_t k = 0; k < points.size(); ++k)
      points[k] = std::fmod(0.618 * double(k), 1.0) * 1.4 - 0.7;
    region = of;
    samples = 2;
    light_samples = v.light_samples;
    max_bounces = 2;
    pixel_offsets = light_square = light_disc = points.data();
    camera_block = 1;
    lens_focus = 8;
    if (v.special == Variant::kLens) {
      camera.assign(2 * samples, 0);
      lens_points = camera.data();
    }
    if (v.special == Variant::kMotion) {
      double frame[12];
      look_at_origin(frame, kEye);
      for (uint32_t k = 0; k < samples; ++k) camera.insert(camera.end(), frame, frame + 12);
      camera_frames = camera.data();
    }
  }
};

}  // namespace glint::bench
