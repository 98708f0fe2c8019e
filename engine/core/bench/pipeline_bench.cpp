// Nanoseconds a pixel sample, tracing apart from all the rest, on one thread:
//   pipeline_bench [quads a side, default 300] [name of a scene]
// Each tile is traced several times and the least time taken, so that other work on the machine is left out.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "../src/scene.h"
#include "../src/timer.h"
#include "../src/tracer.h"

namespace {

using namespace glint;

constexpr uint32_t kWidth = 960, kHeight = 540;
constexpr int kRepeats = 7;

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
    for (double c : {x, y, 0.35 * std::sin(3 * x) * std::cos(2.5 * y) + 0.03 * std::sin(41 * x + 37 * y)}) vertices.push_back(float(c));
    for (double c : {-1.05 * std::cos(3 * x) * std::cos(2.5 * y), 0.875 * std::sin(3 * x) * std::sin(2.5 * y), 1.0})
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
};

const Variant kVariants[] = {
    {"sun", false, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_SUN}, 0, 1},
    {"point", false, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"smooth", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"phong", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_SPECULAR}, {GLINT_POINT_LIGHT}, 0, 1},
    {"textured", true, true, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"three lights", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_SPECULAR}, {GLINT_POINT_LIGHT, GLINT_SUN, GLINT_SPOT}, 0, 1},
    {"soft, 16 samples", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0.4, 16},
    {"mirror", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_MIRROR}, {GLINT_POINT_LIGHT}, 0, 1},
    {"glass", true, false, {GLINT_REFRACTION, GLINT_MIRROR}, {GLINT_POINT_LIGHT}, 0, 1},
    {"veil", true, false, {GLINT_DIFFUSE, GLINT_TRANSPARENT}, {GLINT_POINT_LIGHT}, 0, 1},
};

/// Columns x, y, z, t of a frame at `eye` whose z axis points away from the origin.
void look_at_origin(double (&m)[12], Vec3d eye) {
  Vec3d z = unit(eye), x = unit(cross({0, 0, 1}, z)), y = cross(z, x);
  for (int r = 0; r < 3; ++r) m[4 * r] = x[r], m[4 * r + 1] = y[r], m[4 * r + 2] = z[r], m[4 * r + 3] = eye[r];
}

/// Everything that a scene's description points at.
struct Description {
  GlintGeometry geometry{};
  GlintAttribute uv{};
  GlintInstances instances{};
  double matrix[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  uint32_t slot = 0;
  std::vector<uint8_t> pixels;
  GlintTexture texture{};
  GlintInput input{};
  std::vector<GlintLobe> lobes;
  GlintMaterial material{};
  std::vector<GlintLight> lights;
  GlintSceneData data{};

  Description(const Grid& grid, const Variant& v) {
    place(grid, v);
    paint(v);
    for (int kind : v.lights) light(kind, v.radius);
    GlintCamera& c = data.camera;
    look_at_origin(c.world_from_camera, {5.5, -7, 5});
    const double window[4] = {-0.5, 0.5, -0.5 * kHeight / kWidth, 0.5 * kHeight / kWidth};
    std::copy_n(window, 4, c.window);
    c.clip_start = 0.1, c.clip_end = 1000, c.width = kWidth, c.height = kHeight, c.kind = GLINT_PERSPECTIVE;
    for (int k = 0; k < 3; ++k) data.ambient[k] = 0.05, data.background[k] = 0.2;
    point_at_tables();
  }

  void place(const Grid& grid, const Variant& v) {
    geometry.vertices = grid.vertices.data(), geometry.vertex_count = grid.vertices.size() / 3;
    geometry.triangles = grid.triangles.data(), geometry.primitive_count = grid.triangles.size() / 3, geometry.kind = GLINT_MESH;
    geometry.attribute_count = 1;
    if (v.smooth) geometry.normals = {grid.normals.data(), grid.normals.size() / 3, 0, GLINT_POINT, 3, 0};
    uv = {grid.uv.data(), grid.uv.size() / 2, 0, GLINT_POINT, 2, 0};
    instances = {0, 1, 0, GLINT_VISIBLE_CAMERA | GLINT_VISIBLE_MIRROR | GLINT_VISIBLE_SHADOW, 0, 1, 0, 0};
  }

  void paint(const Variant& v) {
    for (uint32_t k = 0; k < 4 * 512 * 512; ++k) pixels.push_back(uint8_t(k * 2654435761u >> 24));
    texture = {pixels.data(), 512, 512, GLINT_UINT8, GLINT_SRGB, GLINT_REPEAT, GLINT_LINEAR};
    input = {{0.5, 0.4, 0.3}, {3, 0, 0, 0, 3, 0}, v.textured ? 0 : -1, GLINT_COLOR, -1, -1, GLINT_COLOR, 0};
    for (int kind : v.lobes) lobes.push_back({60, 1.5, 0, 1, kind, kind == GLINT_REFRACTION || v.lobes[0] == GLINT_REFRACTION});
    material = {0, uint32_t(lobes.size()), 0, 0};
  }

  void light(int kind, double radius) {
    GlintLight g{};
    look_at_origin(g.world_from_light, kind == GLINT_SUN ? Vec3d{-2, -1, 3} : Vec3d{2, -3, 5});
    for (double& c : g.color) c = 1;
    g.strength = kind == GLINT_SUN ? 3 : 900, g.radius = radius, g.spot_size = 1, g.spot_blend = 0.3, g.kind = kind;
    g.flags = GLINT_CAST_SHADOW;
    lights.push_back(g);
  }

  void point_at_tables() {
    data.geometries = &geometry, data.geometry_count = 1, data.attributes = &uv, data.attribute_count = 1;
    data.instances = &instances, data.instances_count = 1, data.world_from_object = matrix, data.row_count = 1;
    data.material_slots = &slot, data.material_slot_count = 1, data.textures = &texture, data.texture_count = 1;
    data.inputs = &input, data.input_count = 1, data.lobes = lobes.data(), data.lobe_count = lobes.size();
    data.materials = &material, data.material_count = 1, data.lights = lights.data(), data.light_count = lights.size();
  }
};

struct Seconds {
  double all = 0, tracing = 0;
};

/// The least time of several tries for each tile, summed over the tiles.
Seconds measure(Tracer& tracer, const Film& film) {
  Seconds sum;
  for (const Tile& tile : film.tiles()) {
    Seconds best{1e9, 0};
    tracer.choose(tile);
    for (int k = 0; k < kRepeats; ++k) {
      const double before = tracer.counts().tracing;
      double all = 0;
      {
        const Timer timer(all);
        tracer.trace(1);
      }
      if (all < best.all) best = {all, tracer.counts().tracing - before};
    }
    sum.all += best.all, sum.tracing += best.tracing;
  }
  return sum;
}

void run(const Grid& grid, const Variant& v) {
  const Description description(grid, v);
  const std::atomic<bool> go_on{false};
  Scene scene(description.data);
  scene.build(1, BuildQuality::kBalanced, go_on);
  std::vector<double> points(4 * v.light_samples + 4);
  for (size_t k = 0; k < points.size(); ++k) points[k] = std::fmod(0.618 * double(k), 1.0) * 1.4 - 0.7;
  RenderPlan plan;
  plan.region = {0, 0, kWidth, kHeight}, plan.samples = 2, plan.light_samples = v.light_samples, plan.max_bounces = 2;
  plan.pixel_offsets = plan.light_square = plan.light_disc = points.data();
  Film film(plan.region, 1);
  Tracer tracer(scene, plan, film, go_on);
  const Seconds s = measure(tracer, film);
  const double pixels = double(kWidth) * kHeight, rays = kRepeats * pixels;
  const RayCounts& c = tracer.counts();
  const double others = double(c.mirror + c.refraction + c.transparent) / rays;
  std::printf("%-18s %7.1f ns = tracing %7.1f + rest %7.1f;  rays: camera 1, shadow %.2f, others %.2f\n", v.name, 1e9 * s.all / pixels,
              1e9 * s.tracing / pixels, 1e9 * (s.all - s.tracing) / pixels, double(c.shadow) / rays, others);
}

}  // namespace

int main(int argc, char** argv) {
  const Grid grid(argc > 1 ? uint32_t(std::atoi(argv[1])) : 300);
  for (const Variant& v : kVariants)
    if (argc <= 2 || std::strcmp(argv[2], v.name) == 0) run(grid, v);
}
