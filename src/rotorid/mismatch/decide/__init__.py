"""What may be said of an id: findings and their status, rules, selection of terms, sizes and words."""
