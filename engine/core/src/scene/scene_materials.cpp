// The scene's programs and materials: copied, compared, and what does not vary folded to terms.
#include <cstring>
#include <numeric>
#include <string_view>

#include "program/layout.h"
#include "scene/scene.h"

namespace glint {
namespace {

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

/// Where the next SPECULAR lobe goes, of so many columns, and the next that depends on the view.
struct Rows {
  double* specular;
  int columns;
  double* view;
};

/// Adds a lobe to the terms of its material.
void fold(const LobeShape& lobe, Vec3d ambient, MaterialTerms& terms, Rows& rows) {
  const Vec3d k = coefficient(lobe);
  terms.others |= !lobe.constant;
  if (depends_on_view(lobe)) {
    fold_view(lobe, ambient, rows.view);
    return void(rows.view += ViewTerm::kColumns);
  }
  switch (lobe.kind) {
    case GLINT_AMBIENT:
      add_to(terms.ambient, k * ambient);
      return add_to(terms.glow, k * ambient);
    case GLINT_EMISSION:
      add_to(terms.emission, k);
      return add_to(terms.glow, k);
    case GLINT_DIFFUSE:
      return add_to(terms.diffuse, k);
    case GLINT_SPECULAR:
      for (int c = 0; c < 3; ++c) rows.specular[c] = k[c];
      rows.specular[SpecularTerm::kExponent] = lobe.exponent;
      if (rows.columns >= SpecularTerm::kShaped) {
        rows.specular[SpecularTerm::kMasking] = lobe.masking * lobe.masking;
        rows.specular[SpecularTerm::kFresnel] = SpecularTerm::fresnel(lobe.fresnel, lobe.ior);
      }
      rows.specular += rows.columns;
      return;
    case GLINT_SHEEN:
      for (int c = 0; c < 3; ++c) rows.specular[c] = k[c];
      rows.specular[SpecularTerm::kExponent] = SpecularTerm::kSheen;
      rows.specular[SpecularTerm::kMasking] = lobe.exponent;
      rows.specular[SpecularTerm::kFresnel] = lobe.masking;
      rows.specular += rows.columns;
      return;
    default:
      terms.others |= any(k);
  }
}

constexpr ptrdiff_t kReadsCompared = 16;

bool same_read(const GlintInput& a, const GlintInput& b) {
  const bool as_alpha = a.channel == GLINT_ALPHA,
             same_kind = as_alpha == (b.channel == GLINT_ALPHA);
  return same_kind && a.texture == b.texture && a.uv == b.uv &&
         std::equal(a.uv_transform, a.uv_transform + 6, b.uv_transform);
}

bool depends_on_surface(const GlintInput& input) {
  return input.texture >= 0 || input.attribute >= 0 || input.output > 0;
}

/// Whether some instruction is one of these operations.
bool has_one(const int32_t* word, uint64_t count, std::initializer_list<std::string_view> names) {
  bool found = false;
  for (const int32_t* const end = word + count; word < end; word += kLayouts[*word].words())
    found = found || std::ranges::count(names, kLayouts[*word].name) > 0;
  return found;
}

Vec3d finite_or_zero(Vec3d c) {
  return {std::isfinite(c.x) ? c.x : 0, std::isfinite(c.y) ? c.y : 0, std::isfinite(c.z) ? c.z : 0};
}

}  // namespace

Vec3d factor_of(const GlintInput& input, double read) {
  Vec3d k = finite_or_zero(read * Vec3d{input.value[0], input.value[1], input.value[2]});
  for (int c = 0; input.bounded && c < 3; ++c)
    k[c] = std::clamp(k[c] + input.offset[c], input.low, input.high);
  return input.complement ? Vec3d{1, 1, 1} - k : k;
}

void Scene::copy_programs(const GlintSceneData& data) {
  program_words_.assign(data.program_words, data.program_words + data.program_word_count);
  program_constants_ = spread_constants(data.program_constants, data.program_constant_count);
  program_tables_.assign(data.program_tables, data.program_tables + data.program_table_count);
  for (uint64_t i = 0; i < data.program_count; ++i) {
    const GlintProgram& g = data.programs[i];
    programs.push_back(
        {program_words_.data() + g.first_word, g.word_count,
         program_constants_.data() + g.first_constant * kPad,
         program_tables_.data() + g.first_table, g.slots,
         has_one(program_words_.data() + g.first_word, g.word_count, {"ray_length", "ray_depth"}),
         has_one(program_words_.data() + g.first_word, g.word_count,
                 {"ambient_occlusion", "bevel", "raycast", "raycast_attribute"})});
    asks_rays = asks_rays || programs.back().asks_rays;
    most_slots = std::max(most_slots, g.slots);
  }
  if (data.world_program > 0) {
    sky_program = &programs[size_t(data.world_program - 1)];
    sky_slot = size_t(data.world_slot) * kBlock;
  }
  for (int k = 0; k < 3; ++k)
    sky_axes[k] = {data.world_axes[3 * k], data.world_axes[3 * k + 1], data.world_axes[3 * k + 2]};
}

/// The default surface (white DIFFUSE 0.8 with AMBIENT 0.8) follows the given materials.
void Scene::compile_materials(const GlintSceneData& data) {
  reads.resize(inputs.size());
  std::iota(reads.begin(), reads.end(), 0u);
  for (uint64_t i = 0; i < data.material_count; ++i) add_material(data.materials[i], data.lobes);
  materials.push_back({uint32_t(lobes.size()), 2, 0});
  for (int kind : {GLINT_DIFFUSE, GLINT_AMBIENT})
    lobes.push_back({kind, true, false, 0, 0, 1, 0, {0.8, 0.8, 0.8}, 0, 0, 0, 0, 0, 0, 0});
  for (Material& material : materials) {
    compare_lobes(material);
    number_reads(material);
  }
}

/// AMBIENT lobes of a world that gives them nothing are left out.
void Scene::add_material(const GlintMaterial& g, const GlintLobe* given) {
  const size_t first = lobes.size();
  for (uint32_t k = 0; k < g.lobe_count; ++k)
    if (given[g.first_lobe + k].kind != GLINT_AMBIENT || any(ambient))
      add_lobe(given[g.first_lobe + k]);
  materials.push_back({uint32_t(first), uint32_t(lobes.size() - first), g.index, g.program,
                       g.normal, g.crypto, g.aov, g.medium, g.bump_shadowing, g.base_normal});
  bends_normals = bends_normals || g.normal > 0;
  shadows_bumps = shadows_bumps || (g.normal > 0 && g.bump_shadowing != GLINT_BUMP_NONE);
}

/// Lobes whose inputs do not vary get their product now.
void Scene::add_lobe(const GlintLobe& g) {
  LobeShape lobe{g.kind,     false,        false,         g.fresnel,       g.exponent,
                 g.ior,      g.masking,    {1, 1, 1},     g.exponent_slot, g.masking_slot,
                 g.ior_slot, g.fibre_slot, g.first_input, g.input_count,   g.normal_slot};
  bool varies = g.exponent_slot > 0 || g.masking_slot > 0 || g.ior_slot > 0 || g.normal_slot > 0;
  for (uint32_t k = 0; k < g.input_count; ++k)
    varies = varies || depends_on_surface(inputs[g.first_input + k]);
  lobe.constant = !varies;
  Vec3d k{1, 1, 1};
  for (uint32_t i = 0; !varies && i < g.input_count; ++i)
    k = k * factor_of(inputs[g.first_input + i]);
  for (int c = 0; c < 3; ++c) lobe.k[c] = std::isfinite(k[c]) ? k[c] : 0;
  lobes.push_back(lobe);
}

void Scene::compare_lobes(Material& material) {
  for (uint32_t k = 0; k < material.lobe_count; ++k) {
    const LobeShape& lobe = lobes[material.first_lobe + k];
    material.kinds |= 1u << lobe.kind;
    const bool fibre = is_fibre(lobe.kind), sheen = lobe.kind == GLINT_SHEEN;
    material.specular_count += lobe.kind == GLINT_SPECULAR || sheen || fibre;
    has_fibre = has_fibre || fibre;
    has_sheen = has_sheen || sheen || fibre;
    if (lobe.kind == GLINT_SPECULAR || lobe.kind == GLINT_FIBRE_SPECULAR)
      most_exponent = std::max(most_exponent, lobe.exponent);
    material.view_count += depends_on_view(lobe);
    material.is_rough_glass |= lobe.kind == GLINT_REFRACTION && lobe.exponent > 0;
    const bool shaped = lobe.kind == GLINT_SPECULAR && lobe.masking > 0;
    has_gloss = has_gloss || shaped;
    has_metals = has_metals || (shaped && !(lobe.fresnel & GLINT_DIELECTRIC));
    has_varnish = has_varnish || (shaped && lobe.fresnel & GLINT_DIELECTRIC);
    if (sheen || (lobe.kind == GLINT_SPECULAR && (lobe.masking > 0 || lobe.fresnel)))
      specular_columns = std::max(specular_columns, SpecularTerm::kShaped);
    if (fibre) specular_columns = SpecularTerm::kFibred;
    const bool turns = lobe.normal_slot > 0 || material.lifts(lobe);
    if (turns && lobe.kind == GLINT_SPECULAR) {
      turns_lobes = true;
      specular_columns = SpecularTerm::kTurned;
    }
    if (1u << lobe.kind & kPassing && (lobe.exponent_slot > 0 || lobe.ior_slot > 0))
      passing_columns = std::max(passing_columns, PassingTerm::kShaped);
    if (turns && 1u << lobe.kind & kPassing) passing_columns = PassingTerm::kTurned;
    if (k > 0)
      lobes[material.first_lobe + k].like_last =
          same_inputs(material.first_lobe + k - 1, material.first_lobe + k);
  }
  has_rough_glass |= material.is_rough_glass;
  max_specular = std::max(max_specular, material.specular_count);
  max_view = std::max(max_view, material.view_count);
}

/// Compares each input that reads an image with the last few of its material that do.
void Scene::number_reads(const Material& material) {
  std::vector<uint32_t> seen;
  for (uint32_t l = 0; l < material.lobe_count; ++l) {
    const LobeShape& lobe = lobes[material.first_lobe + l];
    for (uint32_t i = lobe.first_input; i < lobe.first_input + lobe.input_count; ++i) {
      if (inputs[i].texture < 0) continue;
      const auto begin = seen.end() - std::min<ptrdiff_t>(std::ssize(seen), kReadsCompared);
      const auto same = std::find_if(begin, seen.end(),
                                     [&](uint32_t j) { return same_read(inputs[i], inputs[j]); });
      if (same != seen.end()) reads[i] = reads[*same];
      else seen.push_back(i);
    }
  }
}

/// Whether two lobes read the same: they often differ in their kind alone.
bool Scene::same_inputs(size_t a, size_t b) const {
  const LobeShape &p = lobes[a], &q = lobes[b];
  auto same = [&](uint32_t k) {
    return std::memcmp(&inputs[p.first_input + k], &inputs[q.first_input + k],
                       sizeof(GlintInput)) == 0;
  };
  bool good = !p.constant && !q.constant && p.input_count == q.input_count;
  for (uint32_t k = 0; good && k < p.input_count; ++k) good = same(k);
  return good;
}

/// What is the same all over a material; those that vary, or send rays on, are left to the shader.
void Scene::fold_materials() {
  const size_t specular = size_t(specular_columns) * size_t(max_specular),
               view = ViewTerm::kColumns * size_t(max_view);
  specular_terms.assign(specular * (materials.size() + 3), 0.0);
  view_terms.assign(view * (materials.size() + 3), 0.0);
  for (size_t m = 0; m < materials.size(); ++m) {
    MaterialTerms terms{};
    Rows rows{specular_terms.data() + specular * m, specular_columns, view_terms.data() + view * m};
    for (uint32_t i = 0; i < materials[m].lobe_count; ++i)
      fold(lobes[materials[m].first_lobe + i], ambient, terms, rows);
    terms.view_count = uint32_t(materials[m].view_count);
    terms.others |= materials[m].normal > 0;
    if (terms.others) {
      terms = MaterialTerms{};
      terms.others = 1;
      std::fill_n(specular_terms.data() + specular * m, specular, 0.0);
      std::fill_n(view_terms.data() + view * m, view, 0.0);
    }
    material_terms.push_back(terms);
  }
  MaterialTerms around{}, none{}, hole{};
  for (int c = 0; c < 3 && !sky_program; ++c)
    around.glow[c] = around.environment[c] = background[c];
  around.others = sky_program != nullptr;
  around.unlit = !sky_program;
  hole.others = 1;
  none.unlit = 1;
  material_terms.insert(material_terms.end(), {around, none, hole});
  reflected_terms = material_terms;
  for (MaterialTerms& terms : reflected_terms)
    for (int c = 0; features & GLINT_FEATURE_MESH_LIGHT && c < 3; ++c) {
      terms.glow[c] = terms.ambient[c];
      terms.emission[c] = 0;
    }
}

void Scene::count_passing() {
  for (size_t m = 0; m < materials.size(); ++m) {
    if (!material_terms[m].others) continue;
    const LobeShape* first = lobes.data() + materials[m].first_lobe;
    const auto passes = [](const LobeShape& lobe) { return (1u << lobe.kind & kPassing) != 0; };
    materials[m].passing = int(std::count_if(first, first + materials[m].lobe_count, passes));
    max_passing = std::max(max_passing, materials[m].passing);
  }
}

}  // namespace glint
