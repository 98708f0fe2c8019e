#include "scene/materials.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "bvh/accel.h"
#include "scene/texture.h"

namespace glint {
namespace {

constexpr ptrdiff_t kReadsCompared = 16;

void add_to(double (&sum)[3], Vec3d c) {
  sum[0] += c.x;
  sum[1] += c.y;
  sum[2] += c.z;
}

/// A lobe as a row of ViewTerm.
void fold_view(const LobeShape& lobe, Vec3d ambient, double* row) {
  const Vec3d k = coefficient(lobe) * (lobe.kind == GLINT_AMBIENT ? ambient : Vec3d{1, 1, 1});
  double* color = row + (lobe.kind == GLINT_AMBIENT ? ViewTerm::kAmbient : ViewTerm::kDiffuse);
  for (int c = 0; c < 3; ++c) color[c] += k[c];
  row[ViewTerm::kExponent] = lobe.exponent;
}

/// The rows of a material: of lobes that lights need, and the next that depends on the view.
struct Rows {
  const LobeLayout& layout;
  double *lobes, *view;
  int count[kLobeKinds] = {};

  /// The next row of a kind, with k in it.
  double* next(int kind, Vec3d k) {
    double* const row = lobes + layout.row(kind, count[kind]++);
    for (int c = 0; c < 3; ++c) row[c] = k[c];
    return row;
  }
};

void fold_highlight(const LobeShape& lobe, Vec3d k, Rows& rows) {
  if (lobe.distribution != GLINT_BLINN_PHONG) k = (lobe.exponent + 2) / 8 * k;
  double* const row = rows.next(GLINT_SPECULAR, k);
  row[MicrofacetRow::kExponent] = lobe.exponent;
  if (rows.layout.of[GLINT_SPECULAR].width < MicrofacetRow::kShaped) return;
  row[MicrofacetRow::kMasking] = lobe.masking * lobe.masking;
  row[MicrofacetRow::kFresnel] = MicrofacetRow::fresnel(lobe.fresnel, lobe.ior);
  row[MicrofacetRow::kDistribution] = lobe.distribution;
}

void fold_sheen(const LobeShape& lobe, Vec3d k, Rows& rows) {
  double* const row = rows.next(GLINT_SHEEN, k);
  row[SheenRow::kWidth] = lobe.width;
  row[SheenRow::kLean] = lobe.lean;
}

/// Adds a lobe to the terms of its material.
void fold(const LobeShape& lobe, Vec3d ambient, MaterialTerms& terms, Rows& rows) {
  const Vec3d k = coefficient(lobe);
  terms.others |= !lobe.constant || goes_below(lobe) || lobe.fresnel & GLINT_OUTSIDE;
  if (depends_on_view(lobe)) {
    fold_view(lobe, ambient, rows.view);
    return void(rows.view += ViewTerm::kColumns);
  }
  switch (lobe.kind) {
    case GLINT_AMBIENT: add_to(terms.ambient, k * ambient); return add_to(terms.glow, k * ambient);
    case GLINT_EMISSION: add_to(terms.emission, k); return add_to(terms.glow, k);
    case GLINT_DIFFUSE: return add_to(terms.diffuse, k);
    case GLINT_SPECULAR: return fold_highlight(lobe, k, rows);
    case GLINT_SHEEN: return fold_sheen(lobe, k, rows);
    default: terms.others |= any(k);
  }
}

bool depends_on_surface(const GlintInput& input) {
  return input.texture >= 0 || input.attribute >= 0 || input.output > 0;
}

Vec3d finite_or_zero(Vec3d c) {
  return {std::isfinite(c.x) ? c.x : 0, std::isfinite(c.y) ? c.y : 0, std::isfinite(c.z) ? c.z : 0};
}

/// Lobes whose inputs do not vary get their product now.
void add_lobe(MaterialTable& t, const GlintLobe& g) {
  LobeShape lobe{g, false, false, {1, 1, 1}};
  bool varies = g.exponent_slot > 0 || g.masking_slot > 0 || g.ior_slot > 0 || g.normal_slot > 0 ||
                g.stretch_slot > 0;
  for (uint32_t k = 0; k < g.input_count; ++k)
    varies = varies || depends_on_surface(t.inputs[g.first_input + k]);
  lobe.constant = !varies;
  if (g.kind == GLINT_SPECULAR && g.distribution != GLINT_BLINN_PHONG) {
    lobe.masking = std::max(g.masking, kLeastWidth);
    lobe.exponent = 2 / (lobe.masking * lobe.masking) - 2;
  }
  Vec3d k{1, 1, 1};
  for (uint32_t i = 0; !varies && i < g.input_count; ++i)
    k = k * factor_of(t.inputs[g.first_input + i]);
  for (int c = 0; c < 3; ++c) lobe.k[c] = std::isfinite(k[c]) ? k[c] : 0;
  t.lobes.push_back(lobe);
}

/// AMBIENT lobes of a world that gives them nothing are left out.
void add_material(MaterialTable& t, const GlintMaterial& g, const GlintLobe* given,
                  const World& world) {
  const size_t first = t.lobes.size();
  for (uint32_t k = 0; k < g.lobe_count; ++k)
    if (given[g.first_lobe + k].kind != GLINT_AMBIENT || any(world.ambient))
      add_lobe(t, given[g.first_lobe + k]);
  t.rows.push_back({uint32_t(first), uint32_t(t.lobes.size() - first), g.index, g.program, g.normal,
                    g.crypto, g.aov, g.medium, g.bump_shadowing, g.base_normal});
  t.bends_normals = t.bends_normals || g.normal > 0;
  t.shadows_bumps = t.shadows_bumps || (g.normal > 0 && g.bump_shadowing != GLINT_BUMP_NONE);
}

/// The largest exponent that a highlight may have at a point, and the least.
double narrowest(const LobeShape& lobe) {
  return lobe.distribution != GLINT_BLINN_PHONG && lobe.masking_slot > 0
             ? 2 / (kLeastWidth * kLeastWidth)
             : lobe.exponent;
}
double widest_of(const LobeShape& lobe) {
  return lobe.distribution == GLINT_BLINN_PHONG && lobe.exponent_slot > 0 ? 0 : lobe.exponent;
}

/// Whether two lobes read the same: they often differ in their kind alone.
bool same_inputs(const MaterialTable& t, size_t a, size_t b) {
  const LobeShape &p = t.lobes[a], &q = t.lobes[b];
  auto same = [&](uint32_t k) {
    return std::memcmp(&t.inputs[p.first_input + k], &t.inputs[q.first_input + k],
                       sizeof(GlintInput)) == 0;
  };
  bool good = !p.constant && !q.constant && p.input_count == q.input_count;
  for (uint32_t k = 0; good && k < p.input_count; ++k) good = same(k);
  return good;
}

/// widest: a row of microfacets so far.
void compare_lobes(MaterialTable& t, Material& material, int& widest) {
  for (uint32_t k = 0; k < material.lobe_count; ++k) {
    const LobeShape& lobe = t.lobes[material.first_lobe + k];
    const bool highlight = lobe.kind == GLINT_SPECULAR, mirror = lobe.kind == GLINT_MIRROR;
    material.kinds |= 1u << lobe.kind;
    t.has_fibre = t.has_fibre || is_fibre(lobe.kind);
    if (highlight || lobe.kind == GLINT_FIBRE_SPECULAR)
      t.most_exponent = std::max(t.most_exponent, narrowest(lobe));
    t.has_translucent = t.has_translucent || lobe.kind == GLINT_TRANSLUCENT;
    material.goes_below = material.goes_below || goes_below(lobe);
    material.view_count += depends_on_view(lobe);
    material.is_dense |= lobe.kind == GLINT_TRANSPARENT && (lobe.ior != 1 || lobe.ior_slot > 0);
    material.is_rough_glass |= lobe.kind == GLINT_REFRACTION && lobe.exponent > 0;
    const bool shaped = highlight && lobe.masking > 0;
    t.has_gloss = t.has_gloss || shaped;
    if (shaped) t.least_gloss_exponent = std::min(t.least_gloss_exponent, widest_of(lobe));
    t.has_metals = t.has_metals || (shaped && !(lobe.fresnel & GLINT_DIELECTRIC));
    const bool varnish = shaped && lobe.fresnel & GLINT_DIELECTRIC;
    t.has_varnish = t.has_varnish || varnish;
    t.has_toon_gloss = t.has_toon_gloss || lobe.kind == GLINT_TOON_SPECULAR;
    t.has_mirrors = t.has_mirrors || mirror;
    if (mirror || shaped || (highlight && lobe.fresnel))
      widest = std::max(widest, MicrofacetRow::kShaped);
    t.edges_lobes |= highlight && lobe.fresnel & GLINT_EDGE;
    const bool turns = lobe.normal_slot > 0 || material.lifts(lobe);
    if (turns && (highlight || mirror)) {
      t.turns_lobes = true;
      widest = std::max(widest, MicrofacetRow::kTurned);
    }
    if (lobe.stretch_slot > 0 && highlight) {
      t.stretches_lobes = true;
      widest = MicrofacetRow::kStretched;
    }
    if (1u << lobe.kind & kPassing && (lobe.exponent_slot > 0 || lobe.ior_slot > 0))
      t.passing_columns = std::max(t.passing_columns, PassingTerm::kShaped);
    if (turns && 1u << lobe.kind & kPassing) t.passing_columns = PassingTerm::kTurned;
    if (k > 0)
      t.lobes[material.first_lobe + k].like_last =
          same_inputs(t, material.first_lobe + k - 1, material.first_lobe + k);
  }
  t.has_rough_glass |= material.is_rough_glass;
  t.has_dense |= material.is_dense;
  t.has_subsurface |= material.goes_below;
  t.max_view = std::max(t.max_view, material.view_count);
}

/// As many rows of each kind as the material needs that needs most of them.
void count_rows(MaterialTable& t, const Material& material) {
  int count[kLobeKinds] = {};
  for (uint32_t k = 0; k < material.lobe_count; ++k) {
    const int kind = t.lobes[material.first_lobe + k].kind;
    const bool shares = kind == GLINT_OREN_NAYAR || kind == GLINT_OREN_NAYAR_MULTIPLE;
    count[kind] = shares ? 1 : count[kind] + (kClosures[kind].columns > 0);
    count[GLINT_SPECULAR] += kind == GLINT_FIBRE_SPECULAR;  // where there is no fibre
  }
  for (int kind = 0; kind < kLobeKinds; ++kind)
    t.rows_of_lobes.of[kind].count = std::max(t.rows_of_lobes.of[kind].count, count[kind]);
}

/// Places the rows of all kinds. widest: of microfacets.
void lay_out(MaterialTable& t, int widest) {
  LobeLayout& layout = t.rows_of_lobes;
  std::vector<LobeSpan> shining;
  for (int kind = 0; kind < kLobeKinds; ++kind) {
    LobeRows& rows = layout.of[kind];
    const bool shines = kind == GLINT_SPECULAR || kind == GLINT_MIRROR;
    rows.width = shines ? widest : kClosures[kind].columns;
    rows.first = layout.columns;
    for (int number = 0; number < rows.count; ++number, layout.columns += rows.width)
      (shines ? shining : t.spans).push_back({size_t(layout.columns), size_t(rows.width)});
  }
  t.spans.insert(t.spans.end(), shining.begin(), shining.end());
}

/// Compares each input that reads an image with the last few of its material that do.
void number_reads(MaterialTable& t, const Material& material) {
  std::vector<uint32_t> seen;
  for (uint32_t l = 0; l < material.lobe_count; ++l) {
    const LobeShape& lobe = t.lobes[material.first_lobe + l];
    for (uint32_t i = lobe.first_input; i < lobe.first_input + lobe.input_count; ++i) {
      if (t.inputs[i].texture < 0) continue;
      const auto begin = seen.end() - std::min<ptrdiff_t>(std::ssize(seen), kReadsCompared);
      const auto same = std::find_if(
          begin, seen.end(), [&](uint32_t j) { return same_read(t.inputs[i], t.inputs[j]); });
      if (same != seen.end()) t.reads[i] = t.reads[*same];
      else seen.push_back(i);
    }
  }
}

/// What is the same all over a material; those that vary, or send rays on, are left to the shader.
void fold_materials(MaterialTable& t, const World& world) {
  const size_t specular = size_t(t.rows_of_lobes.columns),
               view = ViewTerm::kColumns * size_t(t.max_view);
  t.specular_terms.assign(specular * (t.size() + 4), 0.0);
  t.view_terms.assign(view * (t.size() + 4), 0.0);
  for (size_t m = 0; m < t.size(); ++m) {
    MaterialTerms terms{};
    Rows rows{t.rows_of_lobes, t.specular_terms.data() + specular * m,
              t.view_terms.data() + view * m};
    for (uint32_t i = 0; i < t[m].lobe_count; ++i)
      fold(t.lobes[t[m].first_lobe + i], world.ambient, terms, rows);
    terms.view_count = uint32_t(t[m].view_count);
    terms.others |= t[m].normal > 0;
    if (terms.others) {
      terms = MaterialTerms{};
      terms.others = 1;
      std::fill_n(t.specular_terms.data() + specular * m, specular, 0.0);
      std::fill_n(t.view_terms.data() + view * m, view, 0.0);
    }
    t.terms.push_back(terms);
  }
  MaterialTerms around{}, none{}, hole{}, white{};
  for (int c = 0; c < 3 && !world.sky_program; ++c)
    around.glow[c] = around.environment[c] = world.background[c];
  around.others = world.sky_program != nullptr;
  around.unlit = !world.sky_program;
  hole.others = 1;
  none.unlit = 1;
  std::fill_n(white.diffuse, 3, 1.0);
  t.terms.insert(t.terms.end(), {around, none, hole, white});
  t.reflected_terms = t.terms;
}

void count_passing(MaterialTable& t) {
  for (size_t m = 0; m < t.size(); ++m) {
    if (!t.terms[m].others) continue;
    const LobeShape* first = t.lobes.data() + t[m].first_lobe;
    const auto passes = [](const LobeShape& lobe) { return (1u << lobe.kind & kPassing) != 0; };
    t.rows[m].passing = int(std::count_if(first, first + t[m].lobe_count, passes));
    t.max_passing = std::max(t.max_passing, t[m].passing);
  }
}

}  // namespace

Vec3d factor_of(const GlintInput& input, double read) {
  Vec3d k = finite_or_zero(read * Vec3d{input.value[0], input.value[1], input.value[2]});
  for (int c = 0; input.bounded && c < 3; ++c)
    k[c] = std::clamp(k[c] + input.offset[c], input.low, input.high);
  return input.complement ? Vec3d{1, 1, 1} - k : k;
}

bool same_read(const GlintInput& a, const GlintInput& b) {
  const bool as_alpha = a.channel == GLINT_ALPHA,
             same_kind = as_alpha == (b.channel == GLINT_ALPHA);
  return same_kind && a.texture == b.texture && a.uv == b.uv &&
         std::equal(a.uv_transform, a.uv_transform + 6, b.uv_transform);
}

/// The default surface (white DIFFUSE 0.8 with AMBIENT 0.8) follows the given materials.
MaterialTable compile_materials(const GlintSceneData& data, const World& world) {
  MaterialTable t;
  for (uint64_t i = 0; i < data.texture_count; ++i)
    t.textures.push_back(shape_of(data.textures[i]));
  t.inputs.assign(data.inputs, data.inputs + data.input_count);
  t.reads.resize(t.inputs.size());
  std::iota(t.reads.begin(), t.reads.end(), 0u);
  for (uint64_t i = 0; i < data.material_count; ++i)
    add_material(t, data.materials[i], data.lobes, world);
  t.rows.push_back({uint32_t(t.lobes.size()), 2, 0});
  LobeShape white{{}, true, false, {0.8, 0.8, 0.8}};
  white.ior = 1;
  for (int kind : {GLINT_DIFFUSE, GLINT_AMBIENT}) {
    white.kind = kind;
    t.lobes.push_back(white);
  }
  int widest = MicrofacetRow::kPlain;
  for (Material& material : t.rows) {
    compare_lobes(t, material, widest);
    count_rows(t, material);
    number_reads(t, material);
  }
  lay_out(t, widest);
  fold_materials(t, world);
  count_passing(t);
  return t;
}

void hide_emission(MaterialTable& t) {
  for (MaterialTerms& terms : t.reflected_terms)
    for (int c = 0; c < 3; ++c) {
      terms.glow[c] = terms.ambient[c];
      terms.emission[c] = 0;
    }
}

}  // namespace glint
