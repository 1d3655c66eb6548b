"""The paper's cases, figures and statements, beside what is computed and measured here."""
