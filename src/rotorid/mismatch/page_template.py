"""Style and frame of the verdict's page (Jinja2); text comes ready from `rotorid.mismatch.page`."""

CSS = """
:root { --ink: #1d1f22; --soft: #62666c; --line: #dfe1e4; --paper: #ffffff; --tint: #f6f4f0;
  --good: #00734f; --partly: #a86a00; --bad: #b3430a; --calm: #23597f; }
* { box-sizing: border-box; }
html { background: #f1f1ee; }
body { margin: 0 auto; max-width: 54rem; padding: 2.6rem 3.2rem 4rem; background: var(--paper); color: var(--ink);
  font: 17px/1.55 Charter, "Bitstream Charter", "Iowan Old Style", "Palatino Linotype", Georgia, serif;
  font-variant-numeric: lining-nums; }
header { border-bottom: 1px solid var(--line); padding-bottom: 1.2rem; }
.set { color: var(--soft); font-size: .92rem; margin: 0; }
.word { display: inline-block; font: 600 .8rem/1 system-ui, "Segoe UI", sans-serif; letter-spacing: .04em;
  color: #fff; border-radius: 2rem; padding: .42rem .8rem; margin: .9rem 0 .2rem; }
.no_mismatch { background: var(--calm); } .explained { background: var(--good); }
.partly_explained { background: var(--partly); } .unexplained { background: var(--bad); }
h1 { font-size: 1.42rem; line-height: 1.42; font-weight: 500; margin: .6rem 0 .4rem; text-wrap: pretty; }
h2 { font-size: 1.22rem; margin: 2.6rem 0 .5rem; padding-top: .9rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.7rem 0 .2rem; }
h3 code { font-size: .8rem; color: var(--soft); font-weight: 400; margin-left: .5rem; }
p { margin: .5rem 0; text-wrap: pretty; }
code { font-family: ui-monospace, "SF Mono", Menlo, Consolas, monospace; font-size: .84em; }
figure { margin: 1.3rem 0 1rem; } figure img { width: 100%; display: block; }
figcaption { color: var(--soft); font-size: .88rem; line-height: 1.45; margin-top: .3rem; }
.equation { font-style: italic; font-size: 1.12rem; margin: .6rem 0 .6rem 1.4rem; }
.tag { font: 600 .7rem/1 system-ui, sans-serif; letter-spacing: .03em; border: 1px solid currentColor;
  border-radius: 1rem; padding: .16rem .5rem; margin-left: .5rem; vertical-align: .12rem; }
.established { color: var(--good); } .ambiguous { color: var(--partly); } .wrong { color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-size: .9rem; margin: .8rem 0; line-height: 1.35; }
th { text-align: right; font-weight: 600; border-bottom: 1px solid var(--ink); padding: .25rem .45rem; }
td { text-align: right; padding: .22rem .45rem; border-bottom: 1px solid var(--line);
  font-variant-numeric: tabular-nums lining-nums; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; white-space: normal; }
td.text, th.text { text-align: left; white-space: normal; }
td.soft, th.soft { color: var(--soft); } td.strong { font-weight: 600; }
tr.group td { border: 0; padding-top: .7rem; color: var(--soft); font-style: italic; }
.range { position: relative; height: 1.5rem; min-width: 12rem; }
.range i { position: absolute; display: block; }
.range .track { left: 0; right: 0; top: .68rem; height: .14rem; background: var(--line); }
.range .band { top: .52rem; height: .46rem; background: #0072b2; opacity: .38; border-radius: .1rem; min-width: 2px; }
.range .dot { top: .45rem; width: .6rem; height: .6rem; margin-left: -.3rem; border-radius: 50%;
  background: #0072b2; }
.range .belief { top: .3rem; width: 2px; height: .9rem; margin-left: -1px; background: #d55e00; }
.ends { display: flex; justify-content: space-between; color: var(--soft); font-size: .76rem; line-height: 1; }
.next { background: var(--tint); padding: .8rem 1.2rem; border-radius: .3rem; }
ul { padding-left: 1.2rem; margin: .5rem 0; } li { margin: .2rem 0; }
.columns { columns: 2; column-gap: 2.2rem; font-size: .93rem; } .columns li { break-inside: avoid; }
footer { margin-top: 3rem; color: var(--soft); font-size: .85rem; border-top: 1px solid var(--line); }
@media (max-width: 46rem) { body { padding: 1.4rem 1.1rem; } .columns { columns: 1; } }
@media print { html { background: #fff; } body { max-width: none; padding: 0; } h2 { break-after: avoid; }
  figure, table { break-inside: avoid; } }
"""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ set }}: {{ word }}</title>
<style>{{ css }}</style>
</head>
<body>
<header>
<p class="set">Recording set <strong>{{ set }}</strong> · {{ runs }}</p>
<p class="word {{ word_class }}">{{ word }}</p>
<h1>{{ sentence }}</h1>
</header>
{{ figure(hero) }}

<h2>Where</h2>
{% for text in where_text %}<p>{{ text }}</p>
{% endfor %}{{ figure(strip) }}
{{ figure(regime) }}
{% if locations %}<table>
<tr><th>channel</th><th class="text">run</th><th>from</th><th>to</th><th>share of energy</th>
<th class="text">regime</th><th>chance by noise alone</th></tr>
{% for row in locations %}<tr><td>{{ row.channel }}</td><td class="text">{{ row.run }}</td><td>{{ row.start }} s</td>
<td>{{ row.stop }} s</td><td>{{ row.share }}</td><td class="text">{{ row.regime }}</td><td>{{ row.p }}</td></tr>
{% endfor %}</table>{% endif %}
{% if more_locations %}<p class="set">{{ more_locations }}</p>{% endif %}

<h2>What</h2>
{% for text in what_text %}<p>{{ text }}</p>
{% endfor %}{% for e in effects %}
<h3>{{ e.name }}<span class="tag {{ e.status }}">{{ e.status }}</span><code>{{ e.id }}</code></h3>
<p>{{ e.sentence }}</p>
{% if e.equation %}<p class="equation">{{ e.equation }}</p>{% endif %}
{{ ranges(e.parameters) }}
{% for text in e.notes %}<p>{{ text }}</p>
{% endfor %}{% endfor %}
{% if values %}<h3>Values to correct<span class="tag wrong">wrong value</span></h3>
{{ ranges(values) }}{% endif %}

<h2>How much better</h2>
<p>{{ better_text }}</p>
{{ figure(gains) }}
<table>
<tr><th>root mean square error</th><th class="soft">noise</th>
<th colspan="3">held out: believed → refitted → improved</th>
<th class="soft" colspan="3">fitted: believed → refitted → improved</th></tr>
{% for group in table %}<tr class="group"><td colspan="8">{{ group.name }}</td></tr>
{% for row in group.rows %}<tr><td>{{ row.name }} ({{ row.unit }})</td><td class="soft">{{ row.noise }}</td>
{% for cell in row.held_out %}<td{% if loop.last %} class="strong"{% endif %}>{{ cell }}</td>{% endfor %}
{% for cell in row.training %}<td class="soft">{{ cell }}</td>{% endfor %}</tr>
{% endfor %}{% endfor %}</table>

<h2>What remains</h2>
{% for text in rest %}<p>{{ text }}</p>
{% endfor %}

<h2>Ruled out</h2>
{% if ruled_out %}<ul>{% for text in ruled_out %}<li>{{ text }}</li>{% endfor %}</ul>{% endif %}
{% if silent %}<p>Tested, without any sign: {{ silent }}.</p>{% endif %}

<h2>Could not be tested</h2>
{% if not_testable %}<ul class="columns">{% for row in not_testable %}
<li><strong>{{ row.name }}</strong>: {{ row.reason }}</li>{% endfor %}</ul>
{% else %}<p>Every effect of the catalogue could be tested with these columns.</p>{% endif %}

<h2>What to fly next</h2>
<p class="next">{{ next }}</p>

<footer>
{% for text in notes %}<p>{{ text }}</p>
{% endfor %}</footer>
</body>
</html>
"""
